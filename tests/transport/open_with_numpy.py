"""The reader of docs/transfer-format.md: prints the tensors of a file, read with NumPy alone."""
import json
import sys

import numpy as np

DTYPES = {"F32": "<f4", "F16": "<f2", "U64": "<u8", "U32": "<u4", "U16": "<u2", "U8": "u1", "I8": "i1"}


def read_safetensors(path):
    data = np.memmap(path, mode="r")
    begin = 8 + int(data[:8].view("<u8")[0])
    header = json.loads(data[8:begin].tobytes())
    metadata = header.pop("__metadata__")
    tensors = {}
    for name, entry in header.items():
        first, last = entry["data_offsets"]
        values = data[begin + first:begin + last].view(DTYPES[entry["dtype"]])
        tensors[name] = values.reshape(entry["shape"])
    return tensors, metadata


if __name__ == "__main__":
    tensors, metadata = read_safetensors(sys.argv[1])
    print("seed", metadata["seed"])
    for name, values in tensors.items():
        if not name.startswith("padding."):
            print(name, values.dtype, *values.shape, values.astype(float).sum())
