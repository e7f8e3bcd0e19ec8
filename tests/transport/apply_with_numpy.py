"""The product of docs/transfer-format.md: from the senders' radiosity to vector irradiance.

    apply_with_numpy.py FILE RADIOSITY FIELD      both raw float32, [senders, 3] and [N, 3, 3]
"""
import json
import sys

import numpy as np

from open_with_numpy import read_safetensors


def row_numbers(begin):
    """The row of each entry."""
    return np.repeat(np.arange(len(begin) - 1), np.diff(begin.astype(int)))


def sums(row, terms, rows):
    """Adds the terms that belong to each row of a matrix; a line of `terms` is an entry's."""
    return np.stack([np.bincount(row, column, rows) for column in terms.T], axis=1)


def unpack_links(begin, packed):
    """Receiver, sender and value of each link."""
    bits = packed.astype(np.uint32) @ np.array([1, 1 << 8, 1 << 16], np.uint32)
    is_link = bits >> 12 != 0
    reached = np.cumsum(np.where(is_link, bits & 127, bits & 4095), dtype=np.int64)
    row = row_numbers(begin)
    sender = reached - np.append(0, reached)[begin[row].astype(int)] - 1
    nibble = (bits[:, None] >> np.array([12, 16, 20], np.uint32) & 15).astype(np.int32)
    value = (nibble - 16 * (nibble > 7)) * np.exp2((bits >> 7 & 31) - 31.0)[:, None]
    return row[is_link], sender[is_link], value[is_link]


def apply_transfer(tensors, metadata, radiosity):
    level, sender_levels = tensors["level_begin"], json.loads(metadata["model"])["sender_levels"]
    senders, points = level[sender_levels], level[-1]
    parent, weight = tensors["push.index"], tensors["push.value"][:, None]
    child = row_numbers(tensors["push.begin"])
    entries = [slice(tensors["push.begin"][level[l]], tensors["push.begin"][level[l + 1]])
               for l in range(len(level) - 1)]  # of the points of each level
    index, share = tensors["pull.index"], tensors["pull.value"][:, None]
    above = row_numbers(tensors["pull.begin"])
    averaged = [slice(tensors["pull.begin"][level[l]], tensors["pull.begin"][level[l + 1]])
                for l in range(sender_levels - 1)]  # entries of the senders of each level

    # Pull: a coarser point's value becomes the mean of those that it sees below.
    value = radiosity.astype(float)
    for e in reversed(averaged):
        mean = sums(above[e], share[e] * value[index[e]], senders)
        value = np.where(np.bincount(above[e], minlength=senders)[:, None] > 0, mean, value)

    # Coefficients: what the next coarser level does not predict; their mean is that level's.
    e = slice(0, tensors["push.begin"][senders])
    coefficient = value - sums(child[e], weight[e] * value[parent[e]], senders)
    for e in reversed(averaged):
        coefficient += sums(above[e], share[e] * coefficient[index[e]], senders)

    # T e, then push: each level adds what the next coarser one predicts.
    receiver, sender, link = unpack_links(tensors["links.begin"], tensors["links.packed"])
    field = np.concatenate([sums(receiver, link[:, axis, None] * coefficient[sender], points)
                            for axis in range(3)], axis=1)
    for e in entries[1:]:
        field += sums(child[e], weight[e] * field[parent[e]], points)
    return field.reshape(points, 3, 3)


if __name__ == "__main__":
    light = np.fromfile(sys.argv[2], "<f4").reshape(-1, 3)
    apply_transfer(*read_safetensors(sys.argv[1]), light).astype("<f4").tofile(sys.argv[3])
