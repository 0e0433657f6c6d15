"""Whether what kernels multiply and add is compiled for the instructions that they are chosen for.

    python scripts/trust/kernels.py target/release/marsyard

Kernels are compiled once for each instruction set (src/wide.rs, src/train/filter/lanes), and are there whole only if what they call becomes part of
them. What does not is compiled for any x86-64, where a fused multiply-add is a call of `fma`: by one such part, the logistic function, trainings took
six times as long (14.5 CPU seconds for 2.2, of 200 scenes of quickstart.yaml), and no bit told it. The plain form of a kernel calls `fma` rightly; it
lies in the function that chooses between the forms, which calls those for AVX2 and AVX-512, too. Found is every other function that calls `fma`.
Parts without a fused multiply-add are not found.

Needs nm, readelf and objdump, from binutils, and a binary with its symbols. Exit 1 with every such function.
"""

import platform
import re
import shutil
import subprocess
import sys

CALLED = ("fma", "fmaf")
#: A form of a kernel, by either way of writing names.
FORM = re.compile(r"::(avx2|avx512)(::<.*)?$")
#: These go by single rays, beside the kernels: where a sensor stands outside the yard or below its ground.
ALONE = {"marsyard::sweep::cast::raster::RasterCaster::first_hit_with"}


def lines(*command):
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()


def functions(binary):
    """The name of each function, whether it calls `fma` or `fmaf`, directly or by a table of addresses, and whether it calls a form for AVX."""
    symbols = (line.split() for line in lines("nm", binary))
    of_address = {int(fields[0], 16): fields[2] for fields in symbols if len(fields) == 3 and fields[2] in CALLED}
    relocations = (line.split() for line in lines("readelf", "--relocs", "--wide", binary))
    relative = [fields for fields in relocations if len(fields) == 4 and fields[2] == "R_X86_64_RELATIVE"]
    places = {int(fields[0], 16) for fields in relative if int(fields[3], 16) in of_address} | set(of_address)
    found = []
    for line in lines("objdump", "--disassemble", "--demangle", "--no-show-raw-insn", binary):
        if begin := re.match(r"[0-9a-f]+ <(.*)>:$", line):
            found.append([begin[1], False, False])
        elif place := re.search(r"# ([0-9a-f]+) <|\s(?:call|jmp)q?\s+([0-9a-f]+) <([^+]*)(?:\+0x[0-9a-f]+)?>$", line):
            found[-1][1] |= int(place[1] or place[2], 16) in places
            found[-1][2] |= bool(place[3] and FORM.search(place[3]))
    return found


def main(binary):
    if platform.machine() != "x86_64" or platform.system() != "Linux":
        print(f"NOT CHECKED: made for x86-64 and Linux, not for {platform.machine()} and {platform.system()}")
        return
    if missing := [tool for tool in ("nm", "readelf", "objdump") if not shutil.which(tool)]:
        print(f"NOT CHECKED: there is no {missing[0]}, which binutils has")
        return
    found = functions(binary)
    calling = [(name, chooses) for name, calls, chooses in found if calls and name not in CALLED]
    if not any(FORM.search(name) for name, _, _ in found) or not any(chooses for _, chooses in calling):
        sys.exit(f"{binary}: no forms of kernels are found; the binary has no symbols, or this check is out of date")
    wrong = sorted({name for name, chooses in calling if not chooses} - ALONE)
    print(f"{binary}: {len(calling)} functions call {' or '.join(CALLED)}, all in the plain forms of kernels" if not wrong else
          f"{binary}: parts of kernels that are compiled for any x86-64:\n" + "\n".join(f"  {name}" for name in wrong))
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main(sys.argv[1])
