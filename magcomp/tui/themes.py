"""Two looks: one for the workshop, one for sunlight. No meaning is ever in a colour alone."""

from __future__ import annotations

from textual.theme import Theme

NIGHT = Theme(
    name="night",
    primary="#7aa2c8",
    secondary="#9fb4c7",
    accent="#e0b15c",
    foreground="#d8dee6",
    background="#12171d",
    surface="#12171d",
    panel="#1c242d",
    success="#7fbf8a",
    warning="#e0b15c",
    error="#e2777a",
    dark=True,
    variables={
        "quiet": "#93a3b3",
        "border": "#3c4a58",
        "border-blurred": "#2c3742",
        "footer-background": "#1c242d",
        "footer-key-foreground": "#e0b15c",
        "footer-description-foreground": "#d8dee6",
        "block-cursor-background": "#7aa2c8",
        "block-cursor-foreground": "#12171d",
        "input-selection-background": "#7aa2c8 40%",
    },
)

# In sunlight a screen has perhaps a fifth of its contrast left: black on white, strong and few
# colours, each at least 7 : 1 against the paper, no greys.
SUN = Theme(
    name="sun",
    primary="#003a75",
    secondary="#003a75",
    accent="#7a1f00",
    foreground="#000000",
    background="#ffffff",
    surface="#ffffff",
    panel="#e4e9ee",
    success="#004d1a",
    warning="#6b3a00",
    error="#8f0010",
    dark=False,
    text_alpha=1.0,
    variables={
        "quiet": "#1c1c1c",
        "border": "#000000",
        "border-blurred": "#000000",
        "footer-background": "#000000",
        "footer-key-foreground": "#ffe08a",
        "footer-description-foreground": "#ffffff",
        "block-cursor-background": "#003a75",
        "block-cursor-foreground": "#ffffff",
        "input-selection-background": "#9cc3ee",
    },
)

THEMES = (NIGHT, SUN)

DEFAULT_VARIABLES = {"quiet": "#808080"}
"""What other themes lack: ``quiet`` is for names beside values."""
