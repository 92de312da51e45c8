"""`pneunet completion SHELL`: completion with the tab key, as a script that shtab makes of the parser.

The script is static: no Python starts at a key press.
"""

from argparse import ArgumentParser, _SubParsersAction

from pneunet.arguments import FILES, FOLDERS


def script(parser: ArgumentParser, shell: str) -> str:
    """What the shell is to read: commands, options and choices of the parser, files and folders where its
    arguments are some."""
    import shtab

    _mark(parser, dict.fromkeys(FILES, shtab.FILE) | dict.fromkeys(FOLDERS, shtab.DIRECTORY))
    return shtab.complete(parser, shell)


def _mark(parser, kinds):
    """Say of each argument what completes it, by its type."""
    for action in parser._actions:
        if isinstance(action, _SubParsersAction):
            for command in action.choices.values():
                _mark(command, kinds)
        elif action.type in kinds:
            action.complete = kinds[action.type]
