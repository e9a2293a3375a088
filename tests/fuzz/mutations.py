"""What is done to the bytes of a file: to its bits, numbers and texts, its pieces and its end.

Numbers are looked for, not only hit by chance: counts, lengths and offsets lie between 1 and the
size of the file, and are set to one another, one beside, twice, the end, or an extreme. What lies
packed is unpacked first and packed again.
"""

import io
import random
import re
import struct
import zipfile
import zlib
from collections.abc import Callable
from contextlib import suppress

EXTREMES = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 2**40, 2**63 - 1)
EXTREMES += (2**64 - 1,)

NUMBERS = (b"0", b"-1", b"1", b"2", b"1e9", b"999999999", b"2147483648", b"1e308", b"1e999")
NUMBERS += (b"nan", b"inf", b"-inf", b"-0.0", b"1e-320", b"1,5", b"1.2.3", b"0x10", b"1_0", b"")

FLOATS = (float("nan"), float("inf"), -float("inf"), 1e308, 5e-324, -0.0, 1e-300, 3e38, -999.0)

LINE_ENDS = (b"\n", b"\r\n", b"\r", b"\n\r", b"\x0b", b"\0", b"")

_NUMBER = re.compile(rb"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_WORD = re.compile(rb"[A-Za-z_.$#%]{2,}")

Mutation = Callable[[bytearray, bytes, random.Random], None]


def spoilt(data: bytes, other: bytes, chance: random.Random) -> bytes:
    """The bytes of a file with one to four mutations.

    other : bytes of another file of the kind, from which pieces are taken
    """

    def spoil(piece: bytes) -> bytes:
        held = bytearray(piece)
        for _ in range(chance.randint(1, 4)):
            chance.choice(MUTATIONS)(held, other, chance)
        return bytes(held)

    if chance.random() < 0.7:
        with suppress(zipfile.BadZipFile, zlib.error, struct.error, IndexError):
            if data.startswith(b"PK"):
                return _zip_with(data, spoil, chance)
            if data.startswith(b"MATLAB 5") and data[128:129] == b"\x0f":
                return _mat_with(data, spoil, chance)
    return spoil(data)


def _zip_with(data: bytes, spoil: Callable[[bytes], bytes], chance: random.Random) -> bytes:
    """A zip archive with one of its files spoilt."""
    stream = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(stream, "w") as new:
        names = old.namelist()
        wrong, how = chance.choice(names), chance.choice([0, 8, 12, 14])
        for name in names:
            held = old.read(name)
            new.writestr(name, spoil(held) if name == wrong else held, how)
    return stream.getvalue()


def _mat_with(data: bytes, spoil: Callable[[bytes], bytes], chance: random.Random) -> bytes:
    """A MAT file with one of its packed variables spoilt; a few unpack to more than they say."""
    found, at = [data[:128]], 128
    while at + 8 <= len(data):
        kind, length = struct.unpack_from("<II", data, at)
        piece = data[at + 8 : at + 8 + length]
        found.append(zlib.decompress(piece) if kind == 15 else data[at : at + 8 + length])
        at += 8 + length
    wrong = chance.randrange(1, len(found))
    found[wrong] = spoil(found[wrong])
    if chance.random() < 0.05:
        found[wrong] += bytes(1 << 27)
    packed = [zlib.compress(one, 1) for one in found[1:]]
    return found[0] + b"".join(struct.pack("<II", 15, len(one)) + one for one in packed)


def flip(held: bytearray, _: bytes, chance: random.Random) -> None:
    """Some bits, rather in the head."""
    for _ in range(chance.randint(1, 8)):
        if held:
            held[place(held, chance)] ^= 1 << chance.randrange(8)


def cut(held: bytearray, _: bytes, chance: random.Random) -> None:
    """The end, or rarely the beginning."""
    at = chance.randrange(len(held) + 1)
    if chance.random() < 0.9:
        del held[at:]
    else:
        del held[:at]


def extreme(held: bytearray, _: bytes, chance: random.Random) -> None:
    """A whole number set to an extreme, as a length or an offset may be."""
    _put(held, place(held, chance) // 4 * 4, chance.choice(EXTREMES), chance)


def count(held: bytearray, _: bytes, chance: random.Random) -> None:
    """What looks like a count, a length or an offset set to another that might be one."""
    form = chance.choice(["<H", "<I", "<Q", "<I", "<Q", ">H", ">I", ">Q"])
    size = struct.calcsize(form)
    for _ in range(200):
        at = place(held, chance) // 2 * 2
        if at + size > len(held):
            continue
        (value,) = struct.unpack_from(form, held, at)
        if 0 < value <= len(held):
            near = [value - 1, value + 1, 2 * value, value // 2, -value, value + 8, value - 8]
            far = [at, len(held), len(held) - 1, chance.randrange(len(held)) // 8 * 8]
            new = chance.choice([*near, *far, *EXTREMES]) % 256**size
            held[at : at + size] = struct.pack(form, new)
            return


def real(held: bytearray, _: bytes, chance: random.Random) -> None:
    """A floating-point number set to one that is hard to bear."""
    form = chance.choice(["<d", "<f", ">d", ">f"])
    at = place(held, chance) // 4 * 4
    with suppress(OverflowError):
        held[at : at + struct.calcsize(form)] = struct.pack(form, chance.choice(FLOATS))


def digits(held: bytearray, _: bytes, chance: random.Random) -> None:
    """A number written in digits, every other time without a shift of what follows."""
    _replace(held, _NUMBER, lambda found: chance.choice(NUMBERS), chance)


def word(held: bytearray, other: bytes, chance: random.Random) -> None:
    """A word for another one of the file, or of another."""
    words = _WORD.findall(chance.choice([bytes(held), other])[:20_000]) or [b"x"]
    _replace(held, _WORD, lambda found: chance.choice(words), chance)


def line(held: bytearray, _: bytes, chance: random.Random) -> None:
    """A line taken out, doubled, exchanged or drawn out."""
    lines = bytes(held).split(b"\n")
    at, to = chance.randrange(len(lines)), chance.randrange(len(lines))
    what = chance.randrange(4)
    if what == 0:
        del lines[at]
    elif what == 1:
        lines.insert(to, lines[at])
    elif what == 2:
        lines[at], lines[to] = lines[to], lines[at]
    else:
        lines[at] *= chance.choice([2, 50, 3000])
    if sum(map(len, lines)) < 5_000_000:
        held[:] = b"\n".join(lines)


def ends(held: bytearray, _: bytes, chance: random.Random) -> None:
    """Every line end turned into another, as a transfer of text does."""
    old, new = chance.choice([b"\n", b"\n", b"\r\n", b"\r"]), chance.choice(LINE_ENDS)
    held[:] = bytes(held).replace(old, new)


def repeat(held: bytearray, _: bytes, chance: random.Random) -> None:
    """A piece doubled, or many times."""
    at, size = place(held, chance), chance.choice([1, 8, 64, 512])
    held[at:at] = held[at : at + size] * chance.choice([1, 1, 2, 100])


def remove(held: bytearray, _: bytes, chance: random.Random) -> None:
    """A piece taken out."""
    at = place(held, chance)
    del held[at : at + chance.choice([1, 8, 64, 512])]


def splice(held: bytearray, other: bytes, chance: random.Random) -> None:
    """A piece of another file of the kind."""
    if other:
        at, of, size = place(held, chance), chance.randrange(len(other)), chance.randint(1, 512)
        held[at : at + size] = other[of : of + size]


def append(held: bytearray, other: bytes, chance: random.Random) -> None:
    """Another file, zeros or itself behind the end."""
    held += chance.choice([other, bytes(held), bytes(4096), b"\xff" * 512, b"\n" * 50])


MUTATIONS: list[Mutation] = [flip, cut, extreme, count, count, count, real, digits, word, line]
MUTATIONS += [ends, repeat, remove, splice, append]


def place(held: bytearray, chance: random.Random) -> int:
    """A place in a file, every other time in its first kilobyte, sometimes in its last."""
    most, near = max(len(held), 1), chance.random()
    if near < 0.5:
        return chance.randrange(min(most, 1024))
    return chance.randrange(max(most - 1024, 0) if near < 0.65 else 0, most)


def _put(held: bytearray, at: int, value: int, chance: random.Random) -> None:
    size, order = chance.choice([2, 4, 8]), chance.choice("<>")
    form = order + {2: "H", 4: "I", 8: "Q"}[size]
    held[at : at + size] = struct.pack(form, value & (256**size - 1))


def _replace(
    held: bytearray,
    pattern: re.Pattern[bytes],
    new: Callable[[bytes], bytes],
    chance: random.Random,
) -> None:
    """Something that is looked for near a place."""
    at = place(held, chance)
    found = list(pattern.finditer(held, at, at + 2000))
    if found:
        one = chance.choice(found[:10])
        text, width = new(one[0]), len(one[0])
        if chance.random() < 0.5:
            text = text[:width].rjust(width)
        held[one.start() : one.end()] = text
