"""Markdown of the pages that the bench writes."""


def table(head, rows):
    """Lines of a table: column heads, and rows of anything."""
    return ["| " + " | ".join(head) + " |", "|" + "---|" * len(head), *("| " + " | ".join(map(str, row)) + " |" for row in rows)]
