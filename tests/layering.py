"""Checks who includes whom; prints each include that should not be, and fails if there is any.

A folder may include itself and what lies below it; a library is seen by the files named here alone,
so that it can be replaced in one place. Tests may include everything of ours.
"""
import pathlib
import re
import sys

FOLDERS = {
    "core": {"core"},
    "basis": {"core", "basis"},
    "transport": {"core", "basis", "transport"},
    "viewer": {"core", "basis", "transport", "viewer"},
}
ANYWHERE = r"Eigen/|[a-z_]+$|sys/\w+\.h$|(fcntl|immintrin|spawn|unistd)\.h$"  # and the standard library
PRIVATE = {"core/embree.h": {"core/surface.cpp"}}  # headers that show a library -> who may include them
LIBRARIES = {  # how the included path starts -> the files, or folders' .cpp files, that may name it
    r"embree[34]/": {"core/embree.h"},
    r"OpenEXR/|Imf|Imath|Iex|half\.h": {"core/image.cpp"},
    r"stb/|stb_": {"core/image.cpp", "core/texture_file.cpp"},
    r"tiny_obj_loader": {"core/obj_loader.cpp"},
    r"tbb/|oneapi/": {"core/parallel.cpp"},
    r"sanitizer/": {"core/parallel.cpp"},
    r"nanoflann": {"basis/nearest_points.cpp"},
    r"xxhash": {"core/file.cpp", "transport/safetensors.cpp"},
    r"nlohmann/": {"transport/", "viewer/"},
    r"CLI/": {"transport/", "viewer/"},
    r"(GL|EGL|GLFW)/": {"viewer/", "viewer/gl.h"},
    r"imgui\.h": {"viewer/"},
    r"backends/imgui_": {"viewer/gui.cpp"},
}


def complaints(root):
    for folder, allowed in FOLDERS.items():
        for file in sorted((root / folder).rglob("*")):
            if file.suffix not in (".h", ".cpp"):
                continue
            name = file.relative_to(root).as_posix()
            for line, text in enumerate(file.read_text().splitlines(), 1):
                include = re.match(r"\s*#\s*include\s*([<\"])(.+?)[>\"]", text)
                if include and not is_allowed(name, allowed, *include.groups()):
                    yield f"{name}:{line}: must not include {include[2]}"


def is_allowed(name, folders, quote, path):
    if path in PRIVATE:
        return name in PRIVATE[path]
    if quote == '"':
        return path.split("/")[0] in folders
    for library, files in LIBRARIES.items():
        if re.match(library, path):
            return name in files or (
                name.endswith(".cpp") and any(name.startswith(file) for file in files))
    return re.match(ANYWHERE, path) is not None


if __name__ == "__main__":
    found = list(complaints(pathlib.Path(sys.argv[1])))
    print("\n".join(found) if found else "every include is where it belongs")
    sys.exit(1 if found else 0)
