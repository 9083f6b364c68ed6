"""Arrays of an archive by parts: each rank reads its own, and damage to any part is found."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from tawami.base.entries import Entries


@pytest.mark.parametrize("size", [1, 3, 50])  # of 50 ranks some have no row
def test_parts_make_the_whole_and_damage_to_any_is_found(tmp_path, size):
    path, of_ranks = tmp_path / "a.npz", [SimpleNamespace(rank=r, size=size) for r in range(size)]
    arrays = {"x": np.random.default_rng(0).random((20, 2)), "n": np.arange(7)}
    np.savez(path, **arrays)
    with path.open("rb") as file:
        entries = Entries(path, file)
        for name, array in arrays.items():
            np.testing.assert_array_equal(entries.whole(name), array)
            parts = [entries.rows(name, comm) for comm in of_ranks]
            assert [part.total for part in parts] == [len(array)] * size
            np.testing.assert_array_equal(np.concatenate([part.own for part in parts]), array)
        entries.check([entries.sums(comm) for comm in of_ranks])
    data = bytearray(path.read_bytes())
    at = data.find(arrays["n"].tobytes())
    for k in (at, at + 30, at + arrays["n"].nbytes - 1):
        path.write_bytes(data[:k] + bytes([data[k] ^ 1]) + data[k + 1 :])
        with path.open("rb") as file:
            entries = Entries(path, file)
            sums = [entries.sums(comm) for comm in of_ranks]
        with pytest.raises(ValueError, match="wrong checksum of 'n'"):
            entries.check(sums)


def test_compressed_archives_are_rejected(tmp_path):
    np.savez_compressed(tmp_path / "a.npz", a=np.zeros(100))
    with (tmp_path / "a.npz").open("rb") as file, pytest.raises(ValueError, match="compressed"):
        Entries(tmp_path / "a.npz", file)
