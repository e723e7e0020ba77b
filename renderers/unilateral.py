"""When a contact that only pushes ends, so that no lag of the velocity lets it push the tool away from outside.

Such a contact gives N = max(0, S - K_d ṅ) along the outward normal, with S = -K_p n - F_o·ν - C what is left without
the damper: see `curve_law`. It ends outside, n > 0, where N = 0; and where S <= 0 unless the tool has come nearer
since the tick before, that is, where nothing but the damper pushes a tool that leaves. With the true ṅ the damper does
not: -K_d ṅ < 0. With a velocity v that is filtered, v̇ = a (ṅ - v), it would for some 1/a longer, and gives energy.

With it no such filter makes a contact give energy, however fast the tool comes. Let S = -K_p n, which is so without a
sensor and at C = 0, n <= 0 while the contact lasts, and v_0 <= 0 at the touch. What it takes is

    -∫ N ṅ dt = [K_p n^2 / 2 + K_d w^2 / 2a] + K_d ∫ w^2 dt + K_d [c n] + K_d a ∫ c n dt    while N > 0,

with v = w + c and c = v_0 e^(-a t) what the filter brought along; the last two terms are not negative, as c <= 0 and
n <= 0. Where N vanishes, K_d v = S >= 0: all of U = S^2 / 2 K_p + S^2 / 2 K_d a has been taken, since w >= v there. And
until it presses again, -(K_p + K_d a) Δn + K_d a ∫ v dt = 0 with v >= 0: the tool is no deeper, and U no larger. So at
n = 0 it has given nothing on balance. A touch with v_0 > 0, of a tool that was about to leave, may give what the spring
takes in unfelt, at the most U with S = K_p K_d v_0 / (K_p + K_d a).
"""

from __future__ import annotations

from hapticeval.compiled import compiled
from hapticeval.types import Array

TOUCHES, LAST, MEMORY = range(3)
"""In `memory`: whether the tool touched at the tick before, and where, n in m; then how much that is."""


@compiled
def ends(memory: Array, n: float, pressing: float, spring: float) -> bool:
    """Whether a contact is over at `n`, N being `pressing` and S `spring`; else `memory` holds that it goes on."""
    if n > 0.0 and (pressing <= 0.0 or (spring <= 0.0 and n >= memory[LAST])):
        memory[TOUCHES] = 0.0
        return True
    memory[TOUCHES], memory[LAST] = 1.0, n
    return False
