"""A die tester that speaks OPC UA, for trying things out: a server of asyncua, fed by `athermal simulate`.

    athermal simulate die-tester --days 7 -o week.csv
    python3 die_tester.py week.csv --port 4840 --every 0.02

It has what is measured as variables with units, the correction as variables that can be written, and what is applied, which is the
correction that was written last. A row comes each `--every` seconds; its values have the times of now and so many rows behind.
"""
import argparse
import asyncio
import csv
import sys
from datetime import datetime, timedelta, timezone

from asyncua import Server, ua

UNITS = {"degC": ("Therm", "degC", (0.0, 100.0)), "nm": ("Axis", "nm", (-1e6, 1e6))}


async def main(options):
    server = Server()
    await server.init()
    server.set_endpoint(f"opc.tcp://127.0.0.1:{options.port}/")
    server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
    idx = await server.register_namespace("urn:example:die-tester")

    async def folder(name):
        return await server.nodes.objects.add_object(ua.NodeId(name, idx), name)

    async def variable(parent, name, unit, span, writable=False):
        node = await parent.add_variable(ua.NodeId(name, idx), name.split(".")[-1], 0.0, varianttype=ua.VariantType.Double)
        await node.add_property(idx, "EngineeringUnits", ua.EUInformation(
            NamespaceUri="", UnitId=-1, DisplayName=ua.LocalizedText(unit), Description=ua.LocalizedText(unit)))
        await node.add_property(idx, "EURange", ua.Range(*span))
        if writable:
            await node.set_writable()
        return node

    rows = csv.DictReader(open(options.log) if options.log != "-" else sys.stdin)
    folders, measured, drift, applied = {}, {}, {}, {}
    for column in rows.fieldnames:
        name, _, unit = column.rpartition("_")
        if unit not in UNITS or name.startswith(("true", "applied", "asked")):
            continue
        where, unit, span = UNITS[unit]
        if where not in folders:
            folders[where] = await folder(where)
        measured[column] = await variable(folders[where], f"{where}.{name}", unit, span)
        if where == "Axis":
            for kind, of, can in [("correction", drift, True), ("Applied", applied, False)]:
                if kind not in folders:
                    folders[kind] = await folder(kind)
                of[column] = await variable(folders[kind], f"{kind}.{name}", unit, span, can)
    alive = await folders["correction"].add_variable(
        ua.NodeId("Alive", idx), "Alive", 0, varianttype=ua.VariantType.UInt32)
    await alive.set_writable()

    async def put(node, value, at):
        await server.write_attribute_value(node.nodeid, ua.DataValue(
            ua.Variant(value, ua.VariantType.Double), SourceTimestamp=at))

    async with server:
        print(f"opc.tcp://127.0.0.1:{options.port}: {len(measured)} variables", flush=True)
        # Times of a machine that began so long ago that its last row is of now, at the pace of its rows.
        start = datetime.now(timezone.utc).replace(tzinfo=None)
        begun = None
        for row in rows:
            time = float(row["time_s"])
            begun = time if begun is None else begun
            at = start + timedelta(seconds=time - begun)
            for column, node in drift.items():
                await put(applied[column], await node.read_value(), at)
            for column, node in measured.items():
                if row[column]:
                    offset = await drift[column].read_value() if column in drift else 0.0
                    await put(node, float(row[column]) + offset, at)
            await asyncio.sleep(options.every)


parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("log", help="a log of a simulated die tester, or - for standard input")
parser.add_argument("--port", type=int, default=4840)
parser.add_argument("--every", type=float, default=0.02, help="seconds between two rows")
asyncio.run(main(parser.parse_args()))
