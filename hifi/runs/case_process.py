"""The process of one case, `python -m pneunet.hifi.runs.case_process DIRECTORY`: reads case.json, calls its
function, writes answer.json."""

import importlib
import json
import sys
import traceback
from pathlib import Path
from typing import Any

from pneunet.base.errors import ConvergenceError, InputError
from pneunet.base.files.atomic import write_text
from pneunet.base.files.versions import versions
from pneunet.base.system.log import show_on_screen

#: name of a case's function, which its folder is named by, -> where that function is. Names stay as they were
#: first given, so that moving a module loses no finished case; another name is a place itself, "module:name".
FUNCTIONS = {
    "hifi.study_cases:solve_cell_case": "pneunet.hifi.runs.study.cases:solve_cell_case",
    "hifi.study_cases:solve_design_case": "pneunet.hifi.runs.study.cases:solve_design_case",
    "hifi.campaign_case:solve_campaign_case": "pneunet.hifi.runs.campaign.case:solve_campaign_case",
}
#: how a case can end by itself; hifi.runs.cases adds the ways in which it can be ended
DONE, STOPPED, REFUSED, ERROR, MEMORY = "done", "stopped", "refused", "error", "out of memory"


def answer(function: str, inputs: dict[str, Any], directory: Path) -> dict[str, Any]:
    """{"status", "reason", "result"} of `function` (see FUNCTIONS) called with (inputs, directory)."""
    try:
        module, name = FUNCTIONS.get(function, function).split(":")
        result = getattr(importlib.import_module(module), name)(inputs, directory)
        return {"status": DONE, "reason": "", "result": result}
    except ConvergenceError as error:
        return {"status": STOPPED, "reason": str(error), "result": None}
    except InputError as error:
        return {"status": REFUSED, "reason": str(error), "result": None}
    except Exception as error:
        traceback.print_exc()
        short = MEMORY if isinstance(error, MemoryError) or "bad_alloc" in str(error) else ERROR
        return {"status": short, "reason": f"{type(error).__name__}: {error}", "result": None}


def main(directory: str | Path) -> None:
    show_on_screen()  # into the case's log.txt
    directory = Path(directory)
    case = json.loads((directory / "case.json").read_text())
    found = answer(case["function"], case["inputs"], directory) | {"versions": versions()}
    write_text(directory / "answer.json", json.dumps(found, default=float))


if __name__ == "__main__":
    main(sys.argv[1])
