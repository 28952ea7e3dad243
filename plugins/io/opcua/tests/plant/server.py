"""A plant for tests: a server of asyncua, which does what stands on its standard input, a JSON object a line, and answers with one.

Nodes are `Therm.0`, `Therm.1` … of Double in the namespace `urn:plant`, beside those that are added by hand.
"""
import argparse
import asyncio
import json
import resource
import sys
import time
from datetime import datetime, timedelta, timezone

from asyncua import Server, ua
from asyncua.crypto.permission_rules import User, UserRole

TYPES = {name: getattr(ua.VariantType, name) for name in
         ["Double", "Float", "Int16", "UInt32", "Byte", "String", "Boolean"]}


class Users:
    """Lets one user in by his password, or anybody where none is named."""

    def __init__(self, login):
        self.login = login

    def get_user(self, iserver, username=None, password=None, certificate=None):
        if self.login and [username, password] != self.login:
            return None
        return User(role=UserRole.Admin)


class Plant:
    def __init__(self, options):
        self.options = options
        self.nodes = {}
        self.count = 0
        self.late = 0
        self.runs = True

    async def start(self):
        options = self.options
        self.server = Server(user_manager=Users(options.login.split(":") if options.login else None))
        await self.server.init()
        self.server.set_endpoint(f"opc.tcp://127.0.0.1:{options.port}/")
        policies = [getattr(ua.SecurityPolicyType, name) for name in options.policies.split(",")]
        self.server.set_security_policy(policies)
        if options.certificate:
            await self.server.set_application_uri("urn:plant:server")
            await self.server.load_certificate(options.certificate + ".der")
            await self.server.load_private_key(options.certificate + ".pem")
        # So that the namespace has another number each time.
        for number in range(options.before):
            await self.server.register_namespace(f"urn:before:{number}")
        await self.server.start()
        if options.late:
            print(json.dumps({"open": time.time()}), flush=True)
            await asyncio.sleep(options.late)
        self.idx = await self.server.register_namespace("urn:plant")
        self.folder = await self.server.nodes.objects.add_object(ua.NodeId("Therm", self.idx), "Therm")
        for number in range(options.nodes):
            await self.add(f"Therm.{number}", "Double", 0.0)
        print(json.dumps({"ready": time.time()}), flush=True)

    async def add(self, name, kind, value, unit=None, low=None, high=None, writable=False):
        node = await self.folder.add_variable(
            ua.NodeId(name, self.idx), name, value, varianttype=TYPES[kind])
        if unit:
            await node.add_property(self.idx, "EngineeringUnits", ua.EUInformation(
                NamespaceUri="", UnitId=-1, DisplayName=ua.LocalizedText(unit), Description=ua.LocalizedText(unit)))
            properties = await node.get_properties()
            del properties
        if low is not None:
            await node.add_property(self.idx, "EURange", ua.Range(low, high))
        if writable:
            await node.set_writable()
        self.nodes[name] = (node, TYPES[kind])

    async def write(self, name, value, status=0, at=None, kind=None):
        node, own = self.nodes[name]
        if value == "nan":
            value = float("nan")
        variant = ua.Variant(value, TYPES[kind] if kind else own)
        at = datetime.now(timezone.utc) if at is None else datetime.fromtimestamp(at, timezone.utc)
        await self.server.write_attribute_value(node.nodeid, ua.DataValue(
            variant, ua.StatusCode(status), SourceTimestamp=at.replace(tzinfo=None)))

    async def run(self):
        """Counts in all nodes, so often a second."""
        every = 1.0 / self.options.hz
        due = time.monotonic()
        while True:
            if not self.runs:
                await asyncio.sleep(0.01)
                due = time.monotonic()
                continue
            self.count += 1
            at = datetime.utcnow() - timedelta(milliseconds=5)
            for number in range(self.options.nodes):
                node, kind = self.nodes[f"Therm.{number}"]
                await self.server.write_attribute_value(node.nodeid, ua.DataValue(
                    ua.Variant(float(self.count), kind), SourceTimestamp=at))
            due += every
            left = due - time.monotonic()
            if left < 0:
                self.late += 1
                due = time.monotonic()
            await asyncio.sleep(max(left, 0))

    async def obey(self):
        loop = asyncio.get_running_loop()
        while True:
            line = await loop.run_in_executor(None, sys.stdin.readline)
            if not line:
                return
            order = json.loads(line)
            what = order.pop("do")
            answer = {}
            if what == "add":
                await self.add(**order)
            elif what == "write":
                await self.write(**order)
            elif what == "read":
                value = await self.nodes[order["name"]][0].read_data_value()
                answer = {"value": value.Value.Value, "type": value.Value.VariantType.name}
            elif what == "run":
                self.runs = order["runs"]
            elif what == "count":
                used = resource.getrusage(resource.RUSAGE_SELF)
                answer = {"count": self.count, "late": self.late, "cpu_s": used.ru_utime + used.ru_stime,
                          "mb": used.ru_maxrss / 1024}
            elif what == "sessions":
                answer = {"sessions": len(self.server.iserver.subscription_service.subscriptions)}
            print(json.dumps(answer), flush=True)


def certify(path, kind):
    """Makes a certificate of a server and its key."""
    import ipaddress
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import rsa
    key = rsa.generate_private_key(public_exponent=65537, key_size=2048)
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "the plant")])
    now = datetime.now(timezone.utc)
    begin, end = (now - timedelta(days=2), now - timedelta(days=1)) if kind == "expired" else (
        now - timedelta(days=1), now + timedelta(days=30))
    host = "10.9.8.7" if kind == "wrong-host" else "127.0.0.1"
    names = x509.SubjectAlternativeName([
        x509.UniformResourceIdentifier("urn:plant:server"), x509.IPAddress(ipaddress.ip_address(host))])
    usage = x509.KeyUsage(True, True, True, True, False, True, False, False, False)
    purposes = x509.ExtendedKeyUsage([x509.ExtendedKeyUsageOID.SERVER_AUTH, x509.ExtendedKeyUsageOID.CLIENT_AUTH])
    certificate = (x509.CertificateBuilder().subject_name(name).issuer_name(name).public_key(key.public_key())
                   .serial_number(x509.random_serial_number()).not_valid_before(begin).not_valid_after(end)
                   .add_extension(names, False).add_extension(usage, False).add_extension(purposes, False)
                   .add_extension(x509.BasicConstraints(ca=False, path_length=None), False)
                   .sign(key, hashes.SHA256()))
    with open(path + ".der", "wb") as file:
        file.write(certificate.public_bytes(serialization.Encoding.DER))
    with open(path + ".pem", "wb") as file:
        file.write(key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8,
                                     serialization.NoEncryption()))


async def main(options):
    plant = Plant(options)
    await plant.start()
    if options.hz:
        asyncio.ensure_future(plant.run())
    await plant.obey()


parser = argparse.ArgumentParser()
parser.add_argument("--port", type=int, default=0)
parser.add_argument("--nodes", type=int, default=1)
parser.add_argument("--hz", type=float, default=0)
parser.add_argument("--late", type=float, default=0)
parser.add_argument("--before", type=int, default=0)
parser.add_argument("--login", default="")
parser.add_argument("--policies", default="NoSecurity")
parser.add_argument("--certificate", default="")
parser.add_argument("--certify", default="")
options = parser.parse_args()
if options.certify:
    certify(options.certificate, options.certify)
else:
    asyncio.run(main(options))
