"""Writes the seeds of the corpora beside it: small files that are well formed, one for each thing that a
reader knows. What a search adds to them, and what it found, lies in the same folders under a hash.

    python3 tests/fuzz/make_seeds.py AFTERGLOW     the program, for transfer files; needs Pillow
"""
import io
import pathlib
import struct
import subprocess
import sys
import tempfile
import zlib

from PIL import Image

CORPUS = pathlib.Path(__file__).parent / "corpus"


def write(harness, name, content):
    folder = CORPUS / harness
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())


def make_obj():
    square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
    write("obj", "plain", square + "f 1 2 3 4\n")
    write("obj", "negative", square + "f -4 -3 -2\nf -1 -4 -2\n")
    write("obj", "normals", square + "vn 0 0 1\nvt 0 0\nvt 1 1\nf 1/1/1 2/2/1 3/1/1\nf 1//1 3//1 4//1\n")
    write("obj", "concave", "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 2 1 0\nv 0 4 0\nv nan -inf 1e400\nf 1 2 3 4 5\nf 1 2 6\n")
    write("obj", "bad_indices", square + "f 1 2 9\nf 0 1 2\nf 1 2 99999999999\nf 1\nf 1 2 3\r\n")
    write("obj", "ignored", "# words\no box\ng a b\ns 1\nl 1 2\np 1\n" + square
          + "vp 0.3\ncstype bezier\nf 1 2 3\nt 1/2/3 a b\n")
    write("obj", "materials", "mtllib scene.mtl\n" + square
          + "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl wall\nf 1/1 2/2 3/3 4/4\nusemtl lamp\nf 1 2 3\n"
          "# scene.mtl\nnewmtl wall\nKd 0.2 0.4 7\nmap_Kd picture.png\nnorm picture.png\n"
          "newmtl lamp\nKd 1 1 1\nKa 0 0 0\nKs 0.1 0.1 0.1\nKe 1 1 1\nNs 10\nNi 1.5\nd 0.5\nTr 0.5\nillum 2\n"
          "Tf 1 1 1\nmap_Bump -bm 2.5 -o 0 0 0 -s 1 1 1 -t 0 0 0 -mm 0 1 -clamp on -imfchan l picture.png\n")
    write("obj", "physical", "mtllib scene.mtl\n" + square + "usemtl a\nf 1 2 3\n"
          "# scene.mtl\nnewmtl a\nPr 0.1\nPm 0.2\nPs 0.3\nPc 0.4\nPcr 0.5\naniso 1\nanisor 2\n"
          "map_Ka -blendu off x\nmap_Ks x\nmap_Ns x\nmap_d x\ndisp x\nrefl -type sphere x\nmap_Pr x\n"
          "map_Pm x\nmap_Ps x\nmap_Ke x\nbump ../picture.png\n")
    write("obj", "outside", "mtllib ../none.mtl other.mtl /etc/hostname\nmtllib scene.mtl\n" + square
          + "usemtl a\nf 1 2 3\n# scene.mtl\nnewmtl a\nmap_Kd ..\\picture.png\nmap_Bump /dev/null\n")


def encoded(image, kind, **options):
    out = io.BytesIO()
    image.save(out, kind, **options)
    return out.getvalue()


def png_of_any_size(width, height, data):
    def chunk(name, content):
        return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
            + chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b""))


def make_textures():
    picture = Image.new("RGBA", (9, 7))
    picture.putdata([(x * 28, y * 36, (x * y * 5) % 256, 255 - x * 10) for y in range(7) for x in range(9)])
    rgb = picture.convert("RGB")
    for mode in ("1", "L", "LA", "P", "RGB", "RGBA", "I;16"):
        image = Image.new("I;16", (5, 4), 4660) if mode == "I;16" else (
            rgb.convert(mode) if mode in "1LPRGB" else picture.convert(mode))
        write("texture", "png_" + mode.replace(";", "_"), encoded(image, "PNG"))
    write("texture", "jpeg", encoded(rgb, "JPEG", quality=40))
    write("texture", "jpeg_progressive", encoded(rgb, "JPEG", quality=40, progressive=True))
    write("texture", "jpeg_grey", encoded(rgb.convert("L"), "JPEG", quality=20))
    write("texture", "jpeg_cmyk", encoded(rgb.convert("CMYK"), "JPEG", quality=20))
    write("texture", "bmp", encoded(rgb, "BMP"))
    write("texture", "bmp_palette", encoded(rgb.convert("P"), "BMP")[:1200])
    write("texture", "tga", encoded(rgb, "TGA"))
    write("texture", "tga_rle", encoded(picture, "TGA", compression="tga_rle"))
    write("texture", "gif", encoded(rgb.quantize(8), "GIF"))
    write("texture", "ppm", encoded(rgb, "PPM"))
    write("texture", "pgm", encoded(rgb.convert("L"), "PPM"))
    write("texture", "hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 2\n" + bytes(range(100, 116)))
    write("texture", "hdr_rle", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 8\n\x02\x02\x00\x08"
          + b"\x88\x80" * 4)
    write("texture", "psd", b"8BPS" + struct.pack(">H6xHIIHH", 1, 3, 2, 2, 8, 3) + bytes(12)
          + struct.pack(">H", 0) + bytes(range(12)))
    write("texture", "pic", b"\x53\x80\xf6\x34" + bytes(84) + b"PICT" + struct.pack(">HHfHH", 2, 2, 1.0, 3, 0)
          + b"\x00\x08\x00\xe0" + bytes(range(12)))
    write("texture", "claims_gigabytes", png_of_any_size(8192, 8192, bytes(40)))


def exr(width, height, compression, tiles=None, channels=("B", "G", "R"), pixel_type=2, more=()):
    """A file of one part; the pixels rise, or are all zero where they are compressed in a way of its own."""
    def attribute(name, kind, content):
        return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<I", len(content)) + content
    box = struct.pack("<iiii", 0, 0, width - 1, height - 1)
    listed = b"".join(c.encode() + b"\0" + struct.pack("<IIII", pixel_type, 0, 1, 1) for c in channels) + b"\0"
    header = (attribute("channels", "chlist", listed) + attribute("compression", "compression", bytes([compression]))
              + attribute("dataWindow", "box2i", box) + attribute("displayWindow", "box2i", box)
              + attribute("lineOrder", "lineOrder", b"\0") + attribute("pixelAspectRatio", "float", struct.pack("<f", 1))
              + attribute("screenWindowCenter", "v2f", bytes(8)) + attribute("screenWindowWidth", "float", struct.pack("<f", 1))
              + attribute("seed", "string", b"1"))
    for name, kind, content in more:
        header += attribute(name, kind, content)
    if tiles:
        header += attribute("tiles", "tiledesc", struct.pack("<IIB", *tiles, 0))
    start = struct.pack("<II", 20000630, 2 | (0x200 if tiles else 0)) + header + b"\0"
    size = len(channels) * (2 if pixel_type == 1 else 4)
    if tiles:
        places = [(x, y) for y in range(-(-height // tiles[1])) for x in range(-(-width // tiles[0]))]
        chunks = [struct.pack("<iiii", x, y, 0, 0) + block(
            min(tiles[0], width - x * tiles[0]) * min(tiles[1], height - y * tiles[1]) * size, compression) for x, y in places]
    else:
        lines = {0: 1, 1: 1, 2: 1, 3: 16, 5: 16, 9: 256}.get(compression, 32)
        chunks = [struct.pack("<i", y) + block(min(lines, height - y) * width * size, compression)
                  for y in range(0, height, lines)]
    offsets, at = [], len(start) + 8 * len(chunks)
    for chunk in chunks:
        offsets.append(at)
        at += len(chunk)
    return start + struct.pack(f"<{len(offsets)}Q", *offsets) + b"".join(chunks)


def block(size, compression):
    data = bytes(i * 7 % 60 for i in range(size))
    if compression in (2, 3):
        halves = data[0::2] + data[1::2]
        packed = zlib.compress(bytes([halves[0]]) + bytes((b - a + 128) % 256 for a, b in zip(halves, halves[1:])))
        data = packed if len(packed) < size else data
    return struct.pack("<i", len(data)) + data


def make_exr():
    for compression in range(10):
        write("exr", f"compression_{compression}", exr(6, 5, compression))
    write("exr", "half", exr(40, 20, 3, pixel_type=1))
    write("exr", "tiled", exr(6, 5, 0, tiles=(4, 4)))
    write("exr", "more_channels", exr(3, 2, 2, channels=("A", "B", "G", "R", "Z")))
    write("exr", "attributes", exr(2, 2, 0, more=[
        ("preview", "preview", struct.pack("<II", 2, 1) + bytes(8)),
        ("multiView", "stringvector", struct.pack("<I", 4) + b"left" + struct.pack("<I", 5) + b"right"),
        ("list", "floatvector", bytes(8)), ("key", "keycode", bytes(28)), ("env", "envmap", b"\0"),
        ("m", "m44f", bytes(64)), ("own", "unknown", bytes(5))]))
    write("exr", "claims_preview", exr(2, 2, 0, more=[
        ("preview", "preview", struct.pack("<II", 20000, 20000) + bytes(8))]))
    write("exr", "claims_strings", exr(2, 2, 0, more=[
        ("multiView", "stringvector", struct.pack("<I", 2000000000) + b"left")]))
    # Two bytes more than a float: left unread, they begin the next attribute, which then has gigabytes.
    write("exr", "claims_after_floats", exr(2, 2, 0, more=[
        ("list", "floatvector", bytes(4) + b"b\0"), ("own", "unknown", bytes(5))]))
    write("exr", "claims_attribute", exr(2, 2, 0).replace(b"seed\0string\0\1\0\0\0", b"seed\0string\0\1\0\0\x70"))
    write("exr", "claims_gigabytes", exr(4, 4, 3).replace(struct.pack("<ii", 3, 3), struct.pack("<ii", 60000, 60000)))
    write("exr", "claims_tiles", exr(4, 4, 0, tiles=(4, 4)).replace(
        struct.pack("<IIB", 4, 4, 0), struct.pack("<IIB", 60000, 60000, 0)))


def make_frame_paths():
    write("frame_path", "whole", '[{"time":0,"camera":{"position":[0,1,2],"target":[0,0,0],"up":[0,1,0],"fov":50},'
          '"light":{"position":[0,2,0],"direction":[0,-1,0],"cone":[10,45],"intensity":[1,2,3]}},'
          '{"time":0.5,"camera":{"position":[1,1,2]}},{"time":1.5e0,"light":{"direction":[0,1,0]}},{}]')
    write("frame_path", "least", '[{"camera":{"position":[0,1,2],"target":[0,0,0]},'
          '"light":{"position":[0,2,0],"direction":[0,-1,0]}}]')
    write("frame_path", "wrong_name", '[{"camera":{"position":[0,1,2],"target":[0,0,0],"pos\\u000a":1}}]')
    write("frame_path", "no_json", '[{"camera"\x1b[31m')
    write("frame_path", "deep", "[" * 2000)
    write("frame_path", "large", '[{"time":-1e308},{"time":1e999},-0,18446744073709551616,"\\ud800"]')


def make_numbers():
    light = "--light-position\n1,2,3\n--light-direction\n0,-1,0\n"
    write("numbers", "light", light + "--light-cone\n10,45.5\n--light-intensity\n1e1,+2,.5\n")
    write("numbers", "camera", light + "--camera-position=0,0,1\n--camera-target\n0,0,0\n--camera-up\n0,1,0\n"
          "--camera-fov\n50\n--size\n640x360\n")
    write("numbers", "run", light + "--threads\n2\n--seed\n18446744073709551615\n--number\n-1.5e-3\n--quiet\n")
    write("numbers", "wrong", light + "--light-cone\n1,nan\n--size\n0x99999999999\n")
    write("numbers", "control", "--light-position\n1,2,\x1b[2J\n--light-direction\n\n")


def make_tables():
    write("csv", "points", "x,y,z,nx,ny,nz\n0,1,2,0,0,1\n\n 1e-3 ,+2,-.5,1,1,1\r\n")
    write("csv", "values", "\ufeffE_r,E_g,E_b\n1,2,3\n0.5,1e10,1e-40\n")
    write("csv", "wrong", "1,2,3,0,0,0\n1,\x1b[31m,3\n1,2\n1,2,3,4\n")


def make_transfers(program):
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for kind in ("neumann", "paper"):
            file = folder / kind
            subprocess.run([program, "precompute", "builtin:cornell", "-o", file, "--quiet", "--operator", kind,
                            *TRANSFER_OPTIONS], check=True)
            write("transfer", kind, file.read_bytes())


TRANSFER_OPTIONS = ["--coarse-radius", "10", "--receiver-levels", "3", "--sender-levels", "2", "--rays", "8",
                    "--bounces", "2", "--no-verification"]

if __name__ == "__main__":
    make_obj()
    make_textures()
    make_exr()
    make_frame_paths()
    make_numbers()
    make_tables()
    make_transfers(sys.argv[1])
