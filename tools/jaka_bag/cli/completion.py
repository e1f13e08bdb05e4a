"""``jaka_bag completion``: a completion script, made from the commands' own options."""
import argparse
from typing import Dict, Iterable, List

from .main import COMMANDS, is_installed, load_command

_BASH = """\
# bash completion of jaka_bag: source <(jaka_bag completion bash)
_jaka_bag() {
    local word=${COMP_WORDS[COMP_CWORD]} command=${COMP_WORDS[1]} options= values=
    COMPREPLY=()
    if [ "$COMP_CWORD" -eq 1 ]; then
        COMPREPLY=($(compgen -W "%(commands)s" -- "$word"))
        return
    fi
    case $command in
%(families)s
    esac
    if [ -n "$values" ]; then
        if [ "$COMP_CWORD" -eq 2 ]; then
            COMPREPLY=($(compgen -W "$values" -- "$word"))
            return
        fi
        command="$command ${COMP_WORDS[2]}" values=
    fi
    case $command in
%(cases)s
    esac
    case "$command ${COMP_WORDS[COMP_CWORD-1]}" in
%(values)s
    esac
    if [ -n "$values" ]; then
        COMPREPLY=($(compgen -W "$values" -- "$word"))
        return
    fi
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
    local -a commands options values
    local name=$words[2]
    commands=(
%(described)s
    )
    if (( CURRENT == 2 )); then
        _describe command commands
        return
    fi
    case $name in
%(families)s
    esac
    if (( $#values )); then
        if (( CURRENT == 3 )); then
            compadd -- $values
            return
        fi
        name="$name $words[3]"
        values=()
    fi
    case $name in
%(cases)s
    esac
    case "$name $words[CURRENT-1]" in
%(values)s
    esac
    if (( $#values )); then
        compadd -- $values
    elif [[ $words[CURRENT] == -* ]]; then
        compadd -- $options
    elif [[ $name == completion ]]; then
        compadd -- bash zsh
    else
        _files
    fi
}
compdef _jaka_bag jaka_bag
"""


EPILOG = """\
examples:
  source <(jaka_bag completion bash)
  jaka_bag completion zsh > ~/.zfunc/_jaka_bag
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``jaka_bag completion`` to a parser."""
    parser.add_argument("shell", choices=("bash", "zsh"), help="to use it: source <(jaka_bag completion SHELL)")


def _options() -> Dict[str, List[argparse.Action]]:
    """Return the options of each installed command, from its own declaration, without those that help hides."""
    result = {}
    for name in filter(is_installed, COMMANDS):
        parser = argparse.ArgumentParser()
        load_command(name).add_arguments(parser)
        result[name] = [action for action in parser._actions
                        if action.option_strings and action.help != argparse.SUPPRESS]
    return result


def options_by_command() -> Dict[str, List[str]]:
    """Return the option words of each installed command."""
    return {name: sorted(word for action in actions for word in action.option_strings)
            for name, actions in _options().items()}


def _values(form: str) -> str:
    """Return a line of a shell's ``case`` for each option that takes one of a few values."""
    return "\n".join(form % ("|".join('"%s %s"' % (name, word) for word in action.option_strings),
                             " ".join(map(str, action.choices)))
                     for name, actions in _options().items() for action in actions if action.choices)


def _families(names: Iterable[str]) -> Dict[str, List[str]]:
    """Return the second words of commands of two words, by the first word."""
    families: Dict[str, List[str]] = {}
    for name in names:
        first, _, second = name.partition(" ")
        if second:
            families.setdefault(first, []).append(second)
    return families


def run(args: argparse.Namespace) -> int:
    """Print the script; return the exit code."""
    options = options_by_command()
    families = _families(options)
    firsts = list(dict.fromkeys(name.split(" ")[0] for name in options))
    if args.shell == "bash":
        print(_BASH % {
            "commands": " ".join(firsts), "values": _values('        %s) values="%s" ;;'),
            "families": _cases('        %s) values="%s" ;;', families),
            "cases": _cases('        "%s") options="%s" ;;', options)}, end="")
    else:
        summaries = {name: COMMANDS[name].summary if name in COMMANDS else " ".join(families[name]) for name in firsts}
        described = "\n".join("        '%s:%s'" % (name, summary.replace("'", "").replace(":", " -"))
                              for name, summary in summaries.items())
        print(_ZSH % {
            "described": described, "values": _values("        %s) values=(%s) ;;"),
            "families": _cases("        %s) values=(%s) ;;", families),
            "cases": _cases('        "%s") options=(%s) ;;', options)}, end="")
    return 0


def _cases(form: str, words: Dict[str, List[str]]) -> str:
    """Return a line of a shell's ``case`` for each name, with its words."""
    return "\n".join(form % (name, " ".join(some)) for name, some in words.items())
