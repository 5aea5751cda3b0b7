"""``pneumarm completion``."""

from typing import Literal

from pneumarm.commands.common import Json
from pneumarm.commands.help_pages import HELP, HELP_ALL
from pneumarm.console import show
from pneumarm.errors import UnusableInput


def completion_(shell: Literal["bash", "zsh", "fish"], /, *, install: bool = False, json: Json = False) -> None:
    """Print the script by which a shell completes commands and options, or install it.

    Once without installing: `source <(pneumarm completion bash)`, or `pneumarm completion fish | source`.

    Parameters
    ----------
    shell
        Which one.
    install
        Put the script where the shell looks for it, and the line that it needs into the shell's start file.
    """
    from pneumarm.cli import app  # which has loaded this module

    app.help_flags = (HELP, HELP_ALL)
    if install:
        try:
            file = str(app.install_completion(shell=shell))
        except OSError as error:
            raise UnusableInput(
                f"{error.filename or shell}: cannot be written ({error.strerror}); print the script and put it "
                "where your shell looks"
            ) from error
        needs = ", if your .zshrc calls compinit" if shell == "zsh" else ""
        show({"shell": shell, "file": file}, json, lambda: [f"{file}: begins to work in the next {shell}{needs}"])
        return
    script = app.generate_completion(shell=shell)
    if json:
        show({"shell": shell, "script": script}, json, list)
    else:
        print(script)
