"""What tests of what the command line says have in common."""

from pneunet.cli import main


def files(folder):
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def refused(capsys, folder, *arguments):
    """The one line on standard error of a command that must fail with exit code 2 and write nothing."""
    before = files(folder)
    assert main([str(a) for a in arguments]) == 2
    error = capsys.readouterr().err
    assert error.startswith("pneunet: ") and error.count("\n") == 1, error
    assert files(folder) == before
    return error


def said(error):
    """pneunet's own lines on standard error; Open MPI 5 frames a notice of its own around or behind them."""
    return [line for line in error.splitlines() if line.startswith("pneunet: ")]


def changed(text, old, new):
    assert old in text
    return text.replace(old, new)
