"""The manual pages of `pneunet COMMAND --help`: what a command is for and writes, examples, where more is."""

from collections.abc import Sequence
from dataclasses import dataclass

EXIT_CODES = """exit codes:
  0    done
  1    pneunet doctor found what must be fixed
  2    bad input, a load that cannot be reached, or too little memory; a line says the fix
  3    a design is written, but does not follow its target
  130  interrupted; the line says how to go on"""


@dataclass(frozen=True)
class Page:
    """about: what it is for, in paragraphs; examples: (command line, what it does); more: pages of docs."""

    about: str
    examples: tuple[tuple[str, str], ...]
    more: str = "docs/use.md"

    def epilog(self) -> str:
        """What stands below the options."""
        return f"{shown(self.examples)}\n\nmore: {self.more}"


def shown(examples: Sequence[tuple[str, str]]) -> str:
    """A section of examples, each command below what it does."""
    return "\n".join(["examples:", *(f"  # {text}\n  {line}" for line, text in examples)])


TOP = Page(
    "From a curve in space to a pneu-net soft manipulator, proven in finite elements.\n\n"
    "Soft robots are cast from silicone with rows of small air chambers. Slant the chambers, and one"
    " pressure makes a finger twist, bend or coil. pneunet answers the inverse question: here is the"
    " curve in space that I want; what do I cast, and at what pressure? Finite elements of the whole"
    " body then confirm or contradict the quick prediction. Every command reads and writes plain"
    " files: start with `pneunet init target`.",
    (
        ("pneunet init target", "a commented target.toml to start from"),
        ("pneunet design target.toml -o out/mine", "what to cast, and at what pressure"),
        ("pneunet shape out/mine --pressure-kPa 10,20,30", "its predicted shapes"),
        ("pneunet run -n 2 solve out/mine", "finite elements of the whole body on 2 MPI ranks"),
        ("pneunet report out/mine", "one HTML page that shows all of it"),
        ("pneunet export out/mine", "moulds to print, and a sheet for the workshop"),
        ("pneunet compare out/mine measured.csv", "what the camera saw, beside the prediction"),
    ),
    "docs/use.md: each command; docs/glossary.md: the words",
)

PAGES = {
    "init": Page(
        "Writes a file with comments to start from. It is complete: the command that reads it runs it"
        " as it is. Lines that begin with '# key =' are what else can be said. A file that is there is"
        " never overwritten.",
        (
            ("pneunet init target", "target.toml: the curve that is wanted, for pneunet design"),
            ("pneunet init design my_finger.toml", "a body made by hand, under a name of your own"),
            ("pneunet init study", "study.toml: cells over a grid of angles"),
        ),
    ),
    "design": Page(
        "Finds the manipulator and the pressure whose predicted centreline lies on the curve. A table"
        " of points is enough; a TOML says more (how the base is held, silicones, what can be cast,"
        " several shapes). Writes design.toml, target.csv, split.toml, centreline.csv, design.png and"
        " run.json, when the design is found. Ends with exit code 3 where the design does not follow"
        " its target. Some seconds; ten times as long under gravity.",
        (
            ("pneunet design my_curve.csv -o out/mine", "points in mm, from base to tip"),
            ("pneunet design octopus", "a target that comes along, into out/octopus"),
            ("pneunet design target.toml --law out/my-law.npz --outside refuse", "a law of your own"),
            ("pneunet run -n 3 design hanging.toml", "the starts side by side: worth it under gravity"),
        ),
        "docs/use-design.md and docs/use-targets.md",
    ),
    "shape": Page(
        "Predicts a design's shapes with the reduced model alone, in a second. Writes"
        " centrelines.csv, a body for ParaView at each pressure, bodies.png and inflation.gif to the"
        " folder shape.",
        (
            ("pneunet shape out/mine", "five steps up to the design's pressure"),
            ("pneunet shape out/mine/design.toml --pressure-kPa 10,20,40", "at pressures of your own"),
            ("pneunet shape out/mine --law analytic -o out/analytic", "by the paper's formulas"),
        ),
    ),
    "workspace": Page(
        "What segments do over angle and pressure, and where the tips of one to three of them go."
        " Writes reach.csv, tips.npz and workspace.png.",
        (
            ("pneunet workspace", "with the paper's silicone and a design's start dimensions"),
            ("pneunet run -n 3 workspace my_workspace.toml", "your own, on three ranks"),
        ),
        "docs/use-workspace.md",
    ),
    "mesh": Page(
        "The body in CAD and as a mesh, with volumes and checks: mesh/manipulator.step, .msh,"
        " .npz and mesh.json. pneunet solve does this by itself; alone it shows whether a body can be"
        " built.",
        (
            ("pneunet mesh out/mine", "with the design's mesh size"),
            ("pneunet mesh out/mine --mesh-size-mm 3 -o out/coarse", "coarser, beside it"),
        ),
    ),
    "export": Page(
        "What a workshop needs: STEP and STL of the body and of every mould, lying as it is printed,"
        " and a sheet (HTML and PDF) with drawing, steps, volumes to mix and the limit of the"
        " pressure. Each mould is checked: closed, manifold, no undercut.",
        (
            ("pneunet export out/mine", "for a print bed of 220 mm, into out/mine/workshop"),
            ("pneunet export out/mine --moulds moulds.toml", "your printer, draft, clearances"),
        ),
        "docs/use-cast.md",
    ),
    "solve": Page(
        "Finite elements of the whole manipulator, inflated step by step. Writes tables, ParaView"
        " files and a checkpoint to the folder solve after every step, so a run that was ended goes on"
        " with --resume.",
        (
            ("pneunet solve out/mine", "serial"),
            ("pneunet run -n 2 solve out/mine", "on 2 MPI ranks"),
            ("pneunet run -n 2 solve out/mine --resume", "on from the last accepted step"),
            ("pneunet solve out/mine --pressure-kPa 10 --mesh-size-mm 3 -o out/quick", "a quick look"),
        ),
        "docs/use.md (loads, controls, what is written) and docs/theory-fe.md",
    ),
    "cell": Page(
        "Finite elements of one pitch of a long segment, in seconds: strains, volume and rod"
        " stiffness over the pressure. Writes cell.csv, run.json and walls.png to the folder cell.",
        (
            ("pneunet init cell", "a cell.toml to start from"),
            ("pneunet cell cell.toml -o out/cell", "solve it"),
        ),
    ),
    "study": Page(
        "The same body over a grid or a list of anything it is made of: one table, one picture. Each"
        " case runs in a process with limits of time and memory, and a study that was ended goes on"
        " with the same command.",
        (
            ("pneunet init study", "a study.toml to start from"),
            ("pneunet run -n 3 study study.toml", "on two cores: rank 0 hands out"),
            ("pneunet study study.toml --retry", "compute again what crashed or ran out of time"),
        ),
        "docs/studies.md",
    ),
    "campaign": Page(
        "Unit cells of many designs that fill the space of dimensions evenly: the data set that a rod"
        " law is trained on, with a data sheet. Goes on after a kill; more designs later keep what is"
        " there.",
        (
            ("pneunet init campaign", "a campaign.toml to start from: one cell, for a try"),
            ("pneunet run -n 3 campaign campaign.toml", "on two cores: rank 0 hands out"),
            ("pneunet run -n 3 campaign campaign.toml --extend old.npz", "take over what is known already"),
        ),
        "docs/rod-law.md",
    ),
    "suggest": Page(
        "Names the designs that would teach a rod law most, as lines for the campaign's file.",
        (
            ("pneunet suggest campaign.toml --kind twisting -n 80", "by the free strains"),
            ("pneunet suggest campaign.toml --kind one-sided --touching", "where walls touch"),
        ),
        "docs/rod-law.md",
    ),
    "train": Page(
        "Learns the law that the rod's sections follow from a campaign's cells, and judges it on"
        " designs that it has not seen. Writes law.npz and tables of its errors (law.md).",
        (
            ("pneunet train out/campaign/cells.npz", "into law.npz beside the data"),
            ("pneunet run -n 3 train out/campaign/cells.npz -o out/my-law.npz", "side by side"),
            ("pneunet design target.toml --law out/my-law.npz", "what it is for"),
        ),
        "docs/rod-law.md",
    ),
    "report": Page(
        "One self-contained HTML page: target, prediction and finite elements side by side, a body to"
        " turn, errors, loads, walls, drawing, and how it was computed. What is not there yet is"
        " named.",
        (("pneunet report out/mine", "out/mine/report.html"),),
    ),
    "view": Page(
        "The body to turn with the mouse, with a slider over the load steps, coloured by stretch,"
        " wall distance or pressure, with target and centreline: a page for any browser, without"
        " network.",
        (
            ("pneunet view out/mine", "out/mine/view.html"),
            ("pneunet view out/mine --film gif", "and a film of the inflation, inflation.gif"),
            ("pneunet view out/mine --window", "and a window, where there is a display"),
        ),
        "docs/use-view.md",
    ),
    "compare": Page(
        "Holds what a camera measured (markers, tip, centreline, angle or displacement over pressure)"
        " against the prediction, with its bars, and fits the modulus that the measurement speaks for.",
        (
            ("pneunet compare out/mine measured.csv", "the tip, an angle or a centreline"),
            ("pneunet compare out/mine measured.csv --markers markers.csv", "markers, and where they sit"),
            ("pneunet compare out/mine measured.csv --fit-wall", "the walls' thickness as well"),
        ),
        "docs/use-compare.md",
    ),
    "fit-material": Page(
        "Fits a material law to a tensile test: columns of strain and stress with their units, one"
        " specimen or many. Writes material.toml, which designs and targets take as it is, and"
        " fit.png.",
        (
            ("pneunet fit-material tensile.csv", "the best of all laws"),
            ("pneunet fit-material tensile.csv --law Yeoh --to-strain-percent 200", "one law, further"),
            ("pneunet fit-material machine.csv --stress-unit MPa --gauge-length-mm 33", "what it left out"),
        ),
        "docs/materials.md",
    ),
    "run": Page(
        "Wraps mpirun: works for root, on machines with fewer cores than ranks and with Open MPI 4"
        " and 5, one thread a rank. Commands that share their work: design, solve, study, campaign,"
        " train, workspace.",
        (
            ("pneunet run -n 2 solve out/mine", "a command of pneunet"),
            ("pneunet run -n 4 -- python my_script.py", "any program"),
        ),
        "docs/use.md (MPI)",
    ),
    "doctor": Page(
        "Checks Python, libraries, compiler, drawing, BLAS and MPI, and says what to type where"
        " something is missing.",
        (("pneunet doctor", "exit code 1 where something must be fixed"),),
    ),
    "completion": Page(
        "Prints what makes a shell complete commands, options and files with the tab key.",
        (
            ('eval "$(pneunet completion bash)"', "now; as a line of ~/.bashrc always"),
            ("pneunet completion zsh > ~/.zfunc/_pneunet", "in a folder of zsh's fpath, before compinit"),
            ("pneunet completion fish > ~/.config/fish/completions/pneunet.fish", "in fish, always"),
        ),
    ),
}
