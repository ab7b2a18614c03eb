"""All commands together: one parser of command lines, and the exit codes of exceptions."""

from __future__ import annotations

import atexit
import gc
import os
import sys
import warnings
from collections.abc import Callable, Sequence
from difflib import get_close_matches
from functools import cache, wraps
from itertools import pairwise
from typing import Any

import typer

from finger_pin.cancellation import signals_interrupt
from finger_pin.commands import (
    export,
    force_capability,
    identify_command,
    observe_command,
    optimise,
    play,
    self_locking,
    simulate_command,
    sweep,
)
from finger_pin.commands.console import Unsuccessful, print_error, print_text
from finger_pin.exceptions import FingerPinError, InputError, IntegrationError, StudyError
from finger_pin.version import __version__

DONE, NOT_WRITTEN, WRONG_INPUT, FAILED, INTERRUPTED = 0, 1, 2, 3, 130
COMMANDS = (
    simulate_command.simulate,
    play.play,
    sweep.sweep,
    optimise.optimise,
    identify_command.identify,
    observe_command.observe,
    self_locking.self_locking,
    force_capability.force_capability,
    export.export,
)
_ENVIRONMENT = {
    # Matrices are small here: BLAS threads take longer to start, and to wait for, than they save.
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    # The search for pydantic's plugins reads the metadata of every installed package.
    "PYDANTIC_DISABLE_PLUGINS": "__all__",
}


def run(name: str | None = None, arguments: Sequence[str] | None = None) -> int:
    """Run a command line; return the exit code.

    0: done. 1: results cannot be written or drawn. 2: the input is wrong. 3: the integration failed. 130: interrupted.

    Args:
        name: The command that the arguments are for, as in ``scripts/``; without it they begin with its name.
        arguments: Arguments; by default those of this process.
    """
    return run_function(None if name is None else next(each for each in COMMANDS if each.__name__ == name), arguments)


def run_function(function: Callable[..., Any] | None, arguments: Sequence[str] | None = None) -> int:
    """Run a command line for one function, by default for any command; return the exit code."""
    _set_up_process()
    program = "finger-pin" if function is None else f"{function.__name__}.py"
    command_line = list(sys.argv[1:] if arguments is None else arguments)
    if function is None and command_line == ["--version"]:
        print_text(f"{program} {__version__}")
        return DONE
    app = typer.Typer(help="Tendon-driven robot fingers.", add_completion=function is None, rich_markup_mode=None)
    for command in COMMANDS if function is None else (function,):
        app.command(command.__name__.replace("_", "-"))(_with_exit_code(command, program))
    try:
        code = typer.main.get_command(app).main(
            command_line if command_line or function else ["--help"], prog_name=program, standalone_mode=False
        )
    except typer.TyperException as error:
        print_error(program, _usage_message(error, command_line))
        return WRONG_INPUT
    return int(code or DONE)


@cache
def _set_up_process() -> None:
    """Set up environment variables before libraries are imported; those already set stay."""
    # Imports create many lasting objects, and commands few cycles: rare garbage collections save a fifth of
    # a short command's time.
    gc.set_threshold(2_000_000)
    # A collection at the end of the process would take half a second.
    atexit.register(gc.freeze)
    for name, value in _ENVIRONMENT.items():
        os.environ.setdefault(name, value)


def _with_exit_code(command: Callable[..., Any], program: str) -> Callable[..., int]:
    """Return a command that prints an exception in one line, with all notes, and returns an exit code."""

    @wraps(command)
    def command_with_exit_code(*arguments: Any, **options: Any) -> int:
        try:
            with signals_interrupt(), warnings.catch_warnings():
                warnings.showwarning = lambda message, *_: print_error(program, f"warning: {message}")
                return int(command(*arguments, **options) or DONE)
        except KeyboardInterrupt as error:
            problem: BaseException = error
            code, text = INTERRUPTED, str(error) or "interrupted"
        except FingerPinError as error:
            codes = {InputError: WRONG_INPUT, IntegrationError: FAILED, StudyError: FAILED, Unsuccessful: FAILED}
            code = next((codes[error_type] for error_type in type(error).__mro__ if error_type in codes), NOT_WRITTEN)
            problem, text = error, str(error)
        except OSError as error:
            path_prefix = f"{error.filename}: " if error.filename else ""
            problem, code = error, NOT_WRITTEN
            text = f"the results cannot be written: {path_prefix}{error.strerror or error}"
        print_error(program, "; ".join([text, *getattr(problem, "__notes__", ())]))
        return code

    return command_with_exit_code


def _usage_message(error: typer.TyperException, command_line: Sequence[str]) -> str:
    """Return the message about a wrong command line: the option, its value and the allowed ones, or all options."""
    option, context = getattr(error, "option_name", None), getattr(error, "ctx", None)
    text = str(error.format_message()) if hasattr(error, "format_message") else str(error)
    if isinstance(error, typer.BadParameter) and error.param is not None and error.message:
        names = error.param.opts
        values = [argument for name, argument in pairwise(command_line) if name in names]
        values += [
            value for name, equals, value in (each.partition("=") for each in command_line) if equals and name in names
        ]
        return f"{names[0]} = {', '.join(values)}: {error.message.removeprefix('Value error, ').rstrip('.')}"
    if context is None or not text.startswith("No such option"):
        return text
    options = [
        name for each in context.command.params for name in (*each.opts, *each.secondary_opts) if name[:1] == "-"
    ]
    options += ["--version"] if hasattr(context.command, "commands") else []
    options = [*options, "--help"]
    hint = "".join(f"; did you mean {each}?" for each in get_close_matches(str(option), options, n=1))
    return f"{option}: no such option; there are {', '.join(options)}{hint}"
