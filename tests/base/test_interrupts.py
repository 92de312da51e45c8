"""Signals: the first is kept for an end in order, the second ends at once; what libraries make of them."""

import signal
import sys
from importlib.machinery import ModuleSpec
from types import SimpleNamespace

import pytest

from pneunet.base.files.atomic import temporary_beside
from pneunet.base.files.folder import leave_all, output_folder
from pneunet.base.system.interrupts import SAME_SECONDS, deferred, handled, is_interrupted, kept
from pneunet.base.system.libraries import load_vtk


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_second_signal_does_not_wait(number):
    with pytest.raises(KeyboardInterrupt), deferred():
        assert not is_interrupted()
        for _ in range(2):  # timeout and its like send one signal twice
            signal.raise_signal(number)
            assert is_interrupted()
        signal.getsignal(number).first -= 2 * SAME_SECONDS
        with deferred():  # one block with the outer one
            signal.raise_signal(number)
        pytest.fail("the second signal was kept, too")
    assert not is_interrupted()


def test_handlers_are_kept_where_a_library_takes_them():
    with handled(lambda *_: None):
        ours = signal.getsignal(signal.SIGINT)
        with kept():
            signal.signal(signal.SIGINT, signal.SIG_DFL)
        assert signal.getsignal(signal.SIGINT) is ours


def test_a_signal_while_vtk_is_loaded_is_heeded_afterwards(monkeypatch):
    """What a signal raises within VTK's own import is lost."""

    def load(module):
        signal.raise_signal(signal.SIGINT)
        seen.append(is_interrupted())

    def find_spec(name, *_):
        loader = SimpleNamespace(create_module=lambda spec: None, exec_module=load)
        return ModuleSpec(name, loader) if name == "pyvista" else None

    seen: list[bool] = []
    monkeypatch.setitem(sys.modules, "pyvista", None)  # what stands there comes back at the end
    del sys.modules["pyvista"]
    monkeypatch.setattr(sys, "meta_path", [SimpleNamespace(find_spec=find_spec), *sys.meta_path])
    with pytest.raises(KeyboardInterrupt):
        load_vtk()
    assert seen == [True]


def test_a_process_that_ends_at_once_leaves_its_folders(tmp_path):
    """Half-written files, locks and empty folders go, files that are whole stay."""
    with output_folder(tmp_path / "out" / "solve"), output_folder(tmp_path / "out" / "mesh") as folder:
        (folder / "whole.npz").touch()
        temporary_beside(folder / "half.npz").touch()
        leave_all()
        assert [p.name for p in (tmp_path / "out").rglob("*")] == ["mesh", "whole.npz"]
