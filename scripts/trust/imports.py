"""What a binary takes from the C library whose last bits differ between machines: nothing.

    python scripts/trust/imports.py target/release/marsyard [OTHER BINARY ...]

Needs nm, from binutils. Exit 1 with every transcendental function that is found.
"""

import subprocess
import sys

# Each has an f32 twin in "f". Not fma, sqrt, floor and their like: IEEE 754 leaves them no choice.
FORBIDDEN = ("sin cos sincos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh exp exp2 exp10 expm1 log log2 log10 "
             "log1p pow hypot cbrt erf erfc lgamma tgamma").split()


def imports(binary):
    """Transcendental functions that a binary takes from the C library."""
    listing = subprocess.run(["nm", "-D", "--undefined-only", str(binary)], capture_output=True, text=True, check=True)
    symbols = [line.split()[-1].split("@")[0] for line in listing.stdout.splitlines() if line.strip()]
    if "malloc" not in symbols:
        sys.exit(f"{binary}: nm lists no imports")
    return [symbol for symbol in symbols if plain(symbol) & set(FORBIDDEN)]


def plain(symbol):
    """The names that a symbol may be a form of: __powf_finite, lgamma_r, expl."""
    name = symbol.removeprefix("__").removesuffix("_finite").removesuffix("_r")
    return {name, name.removesuffix("f"), name.removesuffix("l")}


if __name__ == "__main__":
    found = {binary: imports(binary) for binary in sys.argv[1:]}
    for binary, names in found.items():
        print(f"{binary}: {', '.join(names) or 'no transcendental function is imported'}")
    sys.exit(1 if any(found.values()) else 0)
