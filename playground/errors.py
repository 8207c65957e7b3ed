"""The one exception that reaches a visitor."""


class PlaygroundError(ValueError):
    """One sentence for a person: what was wrong, what is accepted, what to do.

    The app shows it under the control that caused it; the command line prints it on one line and exits with status 2.
    """
