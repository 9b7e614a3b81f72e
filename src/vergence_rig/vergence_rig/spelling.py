"""How a value is spelt in YAML and on a command line, where it was read as another type than the parameter's.

YAML reads off as false, 0 as a number and '3' as a text. Nothing is converted in silence but a whole number where a
float is declared: the error shows the spelling that works.
"""

from typing import Any

_WORDS = {True: ("on", "yes", "true"), False: ("off", "no", "false")}
_LONGEST = 100
_BOOLEANS = {word: value for value, words in _WORDS.items() for word in words}


def spelling_hint(kind: type, is_list: bool, choices: tuple[str, ...] | None, value: Any) -> str:
    """Return how to write what was probably meant, with NAME for the parameter's name; "" where nothing is obvious.

    Args:
        kind: type of the parameter: bool, int, float or str.
        is_list: whether the parameter is a list of them.
        choices: the texts allowed, None for any.
        value: what YAML made of the text.
    """
    if isinstance(value, str) and not (value.isprintable() and len(value) <= _LONGEST and "'" not in value):
        return ""
    if is_list:
        if isinstance(value, kind) or (kind is float and type(value) is int):
            element = f"'{value}'" if kind is str else str(value)
            return f"a list stands in brackets: write NAME: [{element}]"
        return ""
    meant = _meant(kind, choices, value)
    if meant is None:
        return ""
    if kind is str:
        return f"in quotes it is a text: write NAME: '{meant}' in a file, \"NAME:='{meant}'\" on a command line"
    return f"without quotes it is {'true or false' if kind is bool else 'a number'}: write NAME: {meant}"


def _meant(kind: type, choices: tuple[str, ...] | None, value: Any) -> str | None:
    if kind is str:
        if isinstance(value, bool):
            words = [word for word in _WORDS[value] if choices is None or word in choices]
            return words[0] if words else None
        return str(value) if choices is None and isinstance(value, int) else None
    if kind is int and type(value) is float and value.is_integer() and abs(value) < 1e15:
        return str(int(value))
    if not isinstance(value, str):
        return None
    if kind is bool:
        return {True: "true", False: "false"}[_BOOLEANS[value.lower()]] if value.lower() in _BOOLEANS else None
    try:
        kind(value)
    except ValueError:
        return None
    return value.strip()
