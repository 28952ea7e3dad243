#!/usr/bin/env python3
"""Writes the logs of this folder anew, as loggers would: `make.py ATHERMAL`. The machines are those of `athermal simulate`."""

import csv
import math
import random
import subprocess
import sys
from datetime import datetime, timedelta
from pathlib import Path

HERE = Path(__file__).parent
BEGIN = datetime(2026, 3, 2, 6, 0)


def simulated(days, *more, every=60):
    """Rows of a simulated axis, one for each `every` seconds: the time in s, four temperatures, X, Y and Z in nm or None."""
    asked = [sys.argv[1], "simulate", "linear-axis", "--days", str(days), *more, "-q", "-o", "-"]
    table = csv.reader(subprocess.run(asked, capture_output=True, text=True, check=True).stdout.splitlines())
    next(table)
    kept = {}
    for row in table:
        cells = [float(cell) if cell else None for cell in row]
        slot = int(cells[0] // every)
        # Of the rows of a minute the one in which a position was measured, else the first.
        if slot not in kept or (kept[slot][5] is None and cells[5] is not None):
            kept[slot] = cells
    return list(kept.values())


def write(name, head, rows, end="\n", encoding="utf-8"):
    path = HERE / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes((end.join([head, *rows]) + end).encode(encoding))
    assert path.stat().st_size <= 200_000, (name, path.stat().st_size)


def number(value, digits):
    return "" if value is None else f"{value:.{digits}f}"


def two_loggers():
    rows = simulated(2.5, "--seed", "11")
    at = [BEGIN + timedelta(seconds=row[0]) for row in rows]
    temperatures = [f"{t:%Y-%m-%d %H:%M:%S},{','.join(number(v, 3) for v in row[1:5])}" for t, row in zip(at, rows)]
    write("two-loggers/temperatures.csv", "Timestamp,spindle_degC,bed_degC,column_degC,room_degC", temperatures)
    positions = [
        f"{int((t - datetime(1970, 1, 1)).total_seconds() * 1000)},{','.join(number(v, 0) for v in row[5:8])}"
        for t, row in zip(at, rows)
        if row[5] is not None
    ]
    write("two-loggers/positions.csv", "time_ms,X_nm,Y_nm,Z_nm", positions)


def plc():
    rows = simulated(2.5, "--seed", "12")
    german = lambda value, digits: number(value, digits).replace(".", ",")
    lines = []
    for row in rows:
        at = BEGIN + timedelta(seconds=row[0])
        z = None if row[7] is None else row[7] / 1000
        lines.append(f"{at:%d.%m.%Y};{at:%H:%M:%S};{german(row[1], 2)};{german(row[3], 2)};{german(row[4], 2)};{german(z, 3)}")
    head = "Anlage;Fräsmaschine 4\r\nExport;05.03.2026\r\n\r\nDatum;Uhrzeit;Spindel;Ständer;Halle;Z\r\n;;°C;°C;°C;µm"
    write("plc/export.csv", head, lines, end="\r\n", encoding="windows-1252")


def telescope():
    dice = random.Random(13)
    lines, tube = [], 8.0
    for night in range(24):
        at = BEGIN.replace(hour=19) + timedelta(days=night)
        air = 9 + 4 * math.sin(night / 3) + dice.gauss(0, 1)
        tube = air + 4
        for minute in range(0, 60 * 9, 5):
            air -= 0.05 + dice.gauss(0, 0.03)
            tube += (air - tube) * 5 / 70
            focus = 12080 - 19.5 * (tube - 8) + dice.gauss(0, 6)
            measured = f"{focus:.0f}" if minute % 20 == 0 else ""
            lines.append(f"{at + timedelta(minutes=minute):%Y-%m-%dT%H:%M:%SZ},{tube:.2f},{air:.2f},{measured}")
    write("telescope/nights.csv", "utc,tube_degC,air_degC,focus_steps", lines)


def printer():
    lines = []
    for job in range(4):
        rows = simulated(0.8, "--seed", str(20 + job))
        first = next(row[7] for row in rows if row[7] is not None)
        for row in rows:
            z = None if row[7] is None else (row[7] - first) / 1000
            lines.append(f"{job + 1},{row[0]:.0f},{row[1]:.2f},{row[3]:.2f},{row[4]:.2f},{number(z, 3)}")
    write("printer/bed.csv", "job,time_s,bed_degC,frame_degC,room_degC,z_um", lines)


def fleet():
    for number_of, name in enumerate("abc", 1):
        for seed, day in (1, 2), (2, 4):
            rows = simulated(1.5, "--seed", str(30 + seed), "--spread", "30%", "--machine-seed", str(number_of))
            at = [BEGIN + timedelta(days=day, seconds=row[0]) for row in rows]
            lines = [
                f"{t:%Y-%m-%dT%H:%M:%SZ},{','.join(number(v, 3) for v in row[1:5])},{number(row[7], 0)}" for t, row in zip(at, rows)
            ]
            write(f"fleet/{'fit' if seed == 1 else 'new'}/machine={name}/log.csv", "time,t1_degC,t2_degC,t3_degC,t4_degC,Z_nm", lines)


def faults():
    faults = ["--fault", "temperature.t2=stuck,from=20h,for=16h", "--fault", "temperature.t4=missing,from=45h,for=4h"]
    rows = simulated(2.5, "--seed", "14", *faults)
    lines = []
    for nth, row in enumerate(rows):
        if 1400 <= nth < 1500:
            continue
        cells = [number(value, 2) for value in row[1:5]]
        cells[0] = "-999" if 900 <= nth < 960 else cells[0]
        cells[2] = "NA" if 2000 <= nth < 2010 else cells[2]
        lines.append(f"{BEGIN + timedelta(seconds=row[0]):%Y-%m-%d %H:%M:%S},{','.join(cells)},{number(row[7], 0)}")
    write("faults/log.csv", "time,spindle_degC,bed_degC,column_degC,room_degC,Z_nm", lines)


for log in two_loggers, plc, telescope, printer, fleet, faults:
    log()
