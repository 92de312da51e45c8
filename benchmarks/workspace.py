"""What a workspace of a hundred thousand shapes costs."""

import time

SHAPES = 100_000


def hundred_thousand():
    """The default case of `pneunet workspace` with SHAPES shapes, the law read before: best of three, CPU
    s."""
    from pneunet.design.workspace import WorkspaceCase, workspace
    from pneunet.reduced.choice import shipped_law

    law, best = shipped_law(), float("inf")
    for _ in range(3):
        started = time.process_time()
        found = workspace(WorkspaceCase(shapes=SHAPES), law=law)
        best = min(best, time.process_time() - started)
    assert sum(len(cloud.tips) for cloud in found.clouds) == SHAPES
    return {"workspace_100k_seconds": best}
