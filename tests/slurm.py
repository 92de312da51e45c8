"""A SLURM of this machine alone: its own munged, slurmctld and slurmd in a folder, as whoever starts them.

Nothing of a SLURM that the machine may have is touched: key, sockets, ports and state are the folder's.
"""

import os
import secrets
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from pneunet.base.system.launch import SETTINGS

JOB = Path(__file__).resolve().parent.parent / "examples" / "slurm" / "job.sh"
DAEMONS = ("munged", "slurmctld", "slurmd")
#: where Debian has them
PATH = os.pathsep.join([os.environ.get("PATH", os.defpath), "/usr/sbin"])
#: slots that the one node offers, whatever it has
SLOTS = 4
#: after which a job's credentials expire
CREDENTIALS_SECONDS = 3
CONFIGURATION = """ClusterName=private
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
AuthType=auth/munge
CredType=cred/munge
# a job that is put back into the queue waits until its credentials have expired
AuthInfo=socket={folder}/munge.socket,cred_expire={credentials}
SlurmUser={user}
SlurmdUser={user}
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SlurmdParameters=config_overrides
SchedulerParameters=sched_interval=2
MpiDefault=none
ReturnToService=2
NodeName={host} NodeAddr=127.0.0.1 CPUs={slots} RealMemory=4000
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


def missing() -> str:
    """Why there can be no SLURM here; empty where it can."""
    absent = [name for name in DAEMONS if not shutil.which(name, path=PATH)]
    return f"no {', '.join(absent)} here (Debian's slurm-wlm and munge)" if absent else ""


@contextmanager
def private_slurm() -> Iterator[dict[str, str]]:
    """The environment in which sbatch and its like speak to a SLURM that runs for the block."""
    with TemporaryDirectory(prefix="slurm-") as folder:  # short: a socket's path has at most 107 characters
        with _daemons(Path(folder)) as env:
            yield env


@contextmanager
def _daemons(folder):
    folder.chmod(0o755)  # munged wants its socket to be seen by all
    for name in ("state", "spool"):
        (folder / name).mkdir()
    key = folder / "munge.key"
    key.write_bytes(secrets.token_bytes(128))
    key.chmod(0o400)
    configuration = CONFIGURATION.format(
        folder=folder,
        host=socket.gethostname().partition(".")[0],
        user=subprocess.check_output(["id", "-un"], text=True).strip(),
        ports=_free_ports(2),
        slots=SLOTS,
        credentials=CREDENTIALS_SECONDS,
    )
    (folder / "slurm.conf").write_text(configuration)
    env = {**os.environ, "PATH": PATH, "SLURM_CONF": str(folder / "slurm.conf")}
    munge = {"key-file": "munge.key", "socket": "munge.socket", "pid-file": "munged.pid"}
    munge |= {"log-file": "munged.log", "seed-file": "munged.seed"}
    lines = [
        ["munged", "--foreground", *(f"--{option}={folder / file}" for option, file in munge.items())],
        ["slurmctld", "-D"],
        ["slurmd", "-D"],
    ]
    started = []
    try:
        with open(folder / "daemons.log", "w") as log:
            for line in lines:
                started.append(
                    subprocess.Popen(line, env=env, stdout=log, stderr=log, start_new_session=True)
                )
                if line[0] == "munged":
                    _until((folder / "munge.socket").exists, folder, started)
        _until(lambda: _said(["sinfo", "-h", "-o", "%t"], env) == "idle", folder, started)
        yield env
    finally:
        _said(["scancel", "--user", str(os.getuid())], env)
        for process in reversed(started):
            process.send_signal(signal.SIGTERM)
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


@dataclass(frozen=True)
class Job:
    """A job made of examples/slurm/job.sh: its number, what it says, and the environment of its SLURM."""

    number: str
    log: Path
    env: dict[str, str]

    @classmethod
    def submit(cls, env: dict[str, str], folder: Path, command: Sequence[object], ranks: int = 2) -> "Job":
        """Hand in `pneunet COMMAND` on so many ranks, working in `folder`; $PNEUNET may be another."""
        log = folder / "job.log"
        options = ["--parsable", f"--ntasks={ranks}", "--mem-per-cpu=1000M", f"--output={log}"]
        line = ["sbatch", *options, str(JOB), *map(str, command)]
        # launch's: mpirun refuses root, and ranks of a job under test share cores
        told = subprocess.check_output(line, env=SETTINGS | env, text=True, cwd=folder)
        return cls(told.strip(), log, env)

    def state(self) -> str:
        """What SLURM says of it: PENDING, RUNNING, COMPLETED, ..."""
        words = _said(["scontrol", "show", "job", "-o", self.number], self.env).split()
        return dict(word.split("=", 1) for word in words if "=" in word).get("JobState", "")

    def time_is_over(self) -> None:
        """Give it the signal that SLURM gives shortly before; returns when it is in the queue again."""
        subprocess.run(["scancel", "--batch", "--signal=USR1", self.number], env=self.env, check=True)
        self.wait_for(lambda: "back into the queue" in self.log.read_text())
        self.wait_for(lambda: self.state() == "PENDING")
        # SLURM holds it back for two minutes, whatever its configuration says; its credentials must expire
        time.sleep(CREDENTIALS_SECONDS + 2)
        subprocess.run(
            ["scontrol", "update", f"JobId={self.number}", "StartTime=now"], env=self.env, check=True
        )

    def wait_for(self, true: Callable[[], object], seconds: float = 400.0) -> None:
        """Until it is true; RuntimeError with the end of the log after so many seconds."""
        end = time.monotonic() + seconds
        while not true():
            if time.monotonic() > end:
                said = self.log.read_text()[-2000:] if self.log.exists() else "it has not started"
                raise RuntimeError(f"job {self.number} ({self.state()}): {said}")
            time.sleep(0.1)


def _said(command, env):
    return subprocess.run(command, env=env, capture_output=True, text=True, timeout=60).stdout.strip()


def _until(true, folder, started, seconds=60.0):
    end = time.monotonic() + seconds
    while not true():
        if time.monotonic() > end or any(process.poll() is not None for process in started):
            logs = "\n".join(path.read_text()[-1000:] for path in folder.glob("*.log"))
            raise RuntimeError(f"SLURM does not start:\n{logs}")
        time.sleep(0.05)


def _free_ports(number):
    """Ports that nobody listens at now."""
    held = [socket.create_server(("127.0.0.1", 0)) for _ in range(number)]
    ports = [each.getsockname()[1] for each in held]
    for each in held:
        each.close()
    return ports
