"""Markdown of the pages that the bench writes."""


def below_mark(text, part, lines):
    """A page whose `text` is written by hand down to a mark, and whose lines below it are the bench's, of its
    `part`."""
    mark = f"<!-- made by `python -m benchmarks --only {part}` and `--snapshot`; do not edit below -->"
    return "\n".join([text.partition(mark)[0].rstrip(), "", mark, "", *lines]) + "\n"


def table(head, rows):
    """Lines of a table: column heads, and rows of anything."""
    return [
        "| " + " | ".join(head) + " |",
        "|" + "---|" * len(head),
        *("| " + " | ".join(map(str, row)) + " |" for row in rows),
    ]
