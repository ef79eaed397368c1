"""Write the record of the core's size and SHA-256 anew in the wheels of a directory, and with it RECORD.

    python .ci/wheel_record.py DIRECTORY

The last step after a wheel is repaired: auditwheel, delocate and strip change the binary, and a binary that is not that
of its record is not loaded. Standard library only.
"""

from __future__ import annotations

import base64
import csv
import hashlib
import io
import os
import sys
import zipfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from femimpact.core.binary import record_of, record_text


def with_record(wheel: Path) -> str:
    """Write a wheel anew, with the record of the binary that it holds; the name of that binary."""
    with zipfile.ZipFile(wheel) as archive:
        files = {entry: archive.read(entry) for entry in archive.infolist()}
    names = {entry.filename: entry for entry in files}
    binaries = [name for name in names if name in ("femimpact/_core.abi3.so", "femimpact/_core.pyd")]
    lists = [name for name in names if name.endswith(".dist-info/RECORD")]
    records = [record_of(Path(name)).as_posix() for name in binaries]
    if [len(binaries), len(lists)] != [1, 1] or not set(records) <= set(names):
        sys.exit(f"{wheel}: must hold one binary of the core, its record, and one RECORD")
    text = record_text(files[names[binaries[0]]])
    digest = base64.urlsafe_b64encode(hashlib.sha256(text).digest()).rstrip(b"=").decode()
    old, new = io.StringIO(files[names[lists[0]]].decode()), io.StringIO()
    line = [records[0], f"sha256={digest}", str(len(text))]
    csv.writer(new, lineterminator="\n").writerows(line if row[0] == line[0] else row for row in csv.reader(old))
    files[names[records[0]]], files[names[lists[0]]] = text, new.getvalue().encode()
    part = wheel.with_name(f"{wheel.name}.part")
    with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as archive:
        for entry, content in files.items():
            archive.writestr(entry, content)
    os.replace(part, wheel)
    return binaries[0]


def main() -> None:
    """Exit status 1 where there is no wheel, or one without a core."""
    wheels = sorted(Path(sys.argv[1]).glob("*.whl")) if len(sys.argv) == 2 else []
    if not wheels:
        sys.exit("must be given a directory that holds wheels")
    for wheel in wheels:
        print(f"{wheel.name}: record of {with_record(wheel)} written")


if __name__ == "__main__":
    main()
