"""What Windows has not is not asked for: the package in a process in which its modules find only what every system has.

Run as a script this file is that process.
"""

import builtins
import importlib
import importlib.util
import os
import pkgutil
import signal
import subprocess
import sys
import types

import pytest

MODULES = {"fcntl", "grp", "posix", "pty", "pwd", "resource", "syslog", "termios", "tty"}
OF_OS = (
    "chown fork forkpty getgid getloadavg getpgid getsid getuid killpg mkfifo nice register_at_fork sched_getaffinity "
    "sched_setaffinity setsid statvfs uname wait wait3 wait4"
)
OF_SIGNAL = "SIGALRM SIGCHLD SIGHUP SIGKILL SIGPIPE SIGQUIT SIGUSR1 alarm pthread_kill pthread_sigmask setitimer"
SWEEP = ["sweep", "reversals", "--over", "controller.gain=1,2", "--set", "simulation.duration=0.02", "--workers", "2"]


@pytest.mark.slow
def test_all_modules_are_imported_and_a_run_its_page_and_a_sweep_are_published(tmp_path):
    done = subprocess.run([sys.executable, __file__], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    run, sweep = sorted((tmp_path / "results").iterdir())
    assert {each.name for each in run.iterdir()} == {"animation.html", "figures", "scenario.toml", "trajectory.nc"}
    assert {each.name for each in sweep.iterdir()} - {".lock"} == {"figures", "runs.jsonl", "sweep.nc"}


def refuse(*_, **__):
    """Refuse links as Windows does."""
    raise OSError(1314, "A required privilege is not held by the client")


def reduced(module, names, **others):
    """Return a copy of a module without some names."""
    copy = types.ModuleType(module.__name__)
    vars(copy).update({key: each for key, each in vars(module).items() if key not in names.split()} | others)
    return copy


def main():
    """Import all modules of the package; simulate twice, so that a result is replaced; sweep in processes."""
    ordinary = builtins.__import__
    others = {"os": reduced(os, OF_OS, symlink=refuse), "signal": reduced(signal, OF_SIGNAL)}

    def imported(name, own=None, *rest, **named):
        if not str((own or {}).get("__name__")).startswith("finger_pin"):
            return ordinary(name, own, *rest, **named)
        if name.partition(".")[0] in MODULES:
            raise ModuleNotFoundError(f"No module named {name!r}")
        return others.get(name) or ordinary(name, own, *rest, **named)

    builtins.__import__ = imported
    package = importlib.import_module("finger_pin")
    needs = {"finger_pin.learning.stable_baselines": "stable_baselines3", "finger_pin.mujoco.warp": "mujoco_warp"}

    def stopped(name):
        if name not in needs:
            raise

    for module in pkgutil.walk_packages(package.__path__, "finger_pin.", onerror=stopped):
        missing = module.name in needs and importlib.util.find_spec(needs[module.name]) is None
        if not missing and not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    run = importlib.import_module("finger_pin.commands.application").run
    short = ["simulate", "reversals", "--duration", "0.02"]
    return max(run(None, arguments) for arguments in ([*short, "--no-figures"], short, SWEEP))


if __name__ == "__main__":
    sys.exit(main())
