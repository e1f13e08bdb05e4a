"""``jaka_bag completion``: prints a completion script, made from the commands' own options."""
import argparse
from typing import Dict, List

from .main import COMMANDS, is_installed, load_command

_BASH = """\
# bash completion of jaka_bag: source <(jaka_bag completion bash)
_jaka_bag() {
    local word=${COMP_WORDS[COMP_CWORD]} command=${COMP_WORDS[1]} options=
    COMPREPLY=()
    if [ "$COMP_CWORD" -eq 1 ]; then
        COMPREPLY=($(compgen -W "%(commands)s" -- "$word"))
        return
    fi
    case $command in
%(cases)s
    esac
    case $word in
        -*) COMPREPLY=($(compgen -W "$options" -- "$word")) ;;
        *) [ "$command" = completion ] && COMPREPLY=($(compgen -W "bash zsh" -- "$word")) ;;
    esac
}
complete -o default -o bashdefault -F _jaka_bag jaka_bag
"""
_ZSH = """\
#compdef jaka_bag
# zsh completion of jaka_bag: source <(jaka_bag completion zsh)
_jaka_bag() {
    local -a commands options
    commands=(
%(described)s
    )
    if (( CURRENT == 2 )); then
        _describe command commands
        return
    fi
    case $words[2] in
%(cases)s
    esac
    if [[ $words[CURRENT] == -* ]]; then
        compadd -- $options
    elif [[ $words[2] == completion ]]; then
        compadd -- bash zsh
    else
        _files
    fi
}
compdef _jaka_bag jaka_bag
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``jaka_bag completion``."""
    parser.add_argument("shell", choices=("bash", "zsh"), help="to use it: source <(jaka_bag completion SHELL)")


def options_by_command() -> Dict[str, List[str]]:
    """The option words of each command that is installed, from its own declaration."""
    result = {}
    for name in filter(is_installed, COMMANDS):
        parser = argparse.ArgumentParser()
        load_command(name).add_arguments(parser)
        result[name] = sorted(word for action in parser._actions for word in action.option_strings)
    return result


def run(args: argparse.Namespace) -> int:
    """Print the script; the exit code."""
    options = options_by_command()
    if args.shell == "bash":
        cases = "\n".join('        %s) options="%s" ;;' % (name, " ".join(words)) for name, words in options.items())
        print(_BASH % {"commands": " ".join(options), "cases": cases}, end="")
    else:
        cases = "\n".join("        %s) options=(%s) ;;" % (name, " ".join(words)) for name, words in options.items())
        described = "\n".join("        '%s:%s'" % (name, COMMANDS[name].summary.replace("'", "").replace(":", " -"))
                              for name in options)
        print(_ZSH % {"described": described, "cases": cases}, end="")
    return 0
