"""What decides a verdict: every constant of the checks, with its derivation, or the word *chosen*.

Each says what changes when it is doubled. `docs/decisions.md` is written of this module. Constants of the checks of
effects come last.
"""

from __future__ import annotations

import math

import numpy as np

from hapticeval.recordings import energy_balance, recording, stretches

# sampling

LAG_TICKS = stretches.LAG_TICKS
"""Ticks that a proxy may answer late without being wrong, as peers do. *Chosen* after them; doubled, a tool six ticks
late passes, and each bound in HIP steps is twice as wide."""

HOLD_TICKS = 1.5
"""Ticks that a held force lags behind: half of one on average, and one more where it is computed from the last sample.
Derived; doubled, bounds in closed loop are twice as wide, and more of them tell nothing."""

TELLING_SHARE = 0.1
"""Share of what is asked for above which a bound tells nothing. *Chosen*: doubled, verdicts are given where the
sampling may make a fifth of what is asked for."""

FORCE_DEPTH = 5e-6
"""Depth, as a share of the model's size, whose spring force is the least that has a direction: 1 um of 200 mm.

*Chosen*: there single precision (4 * 2^-23 of the size) turns a force by up to 6 degrees. Doubled, by 3, and touches of
up to 2 um are then none."""

FARTHEST_STANDOFF = 1.0 / 50.0
"""Share of the model's size beyond which a declared standoff is not believed: 4 mm of the usual 200 mm. *Chosen*:
doubled, an IHIP 8 mm off counts as declared so."""

COARSEST_RESOLUTION = 1.0 / 16.0
"""Share of the outline beyond which a declared resolution is not believed: 16 facets are no smooth surface. *Chosen*:
doubled, an octagon counts as declared so."""

SINGLE_ROUNDINGS = recording.SINGLE_ROUNDINGS
"""Roundings of single precision, `SINGLE` of a value each, by which what is made of rounded numbers may be off: two
points that are subtracted, and a product and a sum that follow.

*Chosen*: doubled, twice as much is granted to rounding everywhere."""

PLACE_ROUNDING = 1e-9
"""Share of the model's size by which rounding of doubles may move a place that in exact numbers is the same: 0.2 nm of
the usual 200 mm.

*Chosen*, four million roundings: doubled, a tool 0.4 nm off the surface counts as on it, and HIPs so far apart as one
point."""

TIE_SHARE = 1e-9
"""Share by which two equally bad places may differ by rounding: the first of them is named.

*Chosen*, four million roundings: doubled, no outcome changes, for it decides where to look alone."""

SHARE_ROUNDING = 1e-9
"""Share of a speed, a momentum or a force that rounding of normals, roots and quotients may make. *Chosen*, far above
that of doubles: doubled, two parts in a thousand million are granted."""

FIT_SAMPLES = 8
"""Samples that a fit of two to five numbers needs at least. *Chosen*: doubled, contacts and vibrations of 8 to 15
samples are undecided."""

# lag

LAG_STEPS = 4 * LAG_TICKS
"""Lags that are tried first, a quarter of a tick apart.

*Chosen*: a misfit falls towards its lag over a whole tick, since the hand's path is straight from row to row. Twice as
many find the same, in twice the time."""

LAG_HALVINGS = 40
"""Times that the bracket of half a tick is narrowed by the golden section: to 2e-9 of a tick, a thousandth of what any
bound can tell. *Chosen*; doubled, no lag changes by more than that."""

LAG_ROWS = 4096
"""Rows, spread over all, in which a lag is looked for: *chosen*, for time. With twice as many it is the same number."""

LIKELY_SHARE = 0.5
"""Share of what a spring leaves of the force without a lag that it may leave with one, for a law of friction to be
asked with that lag: a tool that breaks away between two ticks is blurred by a lag between them, and no spring fits it.

*Chosen*: doubled, every law is asked with some lag, and a force that chatters hides in what its kinks leave open."""

LAW_RANK = 1e-9
"""Singular values of the normal equations of a spring's two laws below this share of the largest count as zero.
*Chosen*, far above rounding: at one depth both are one law. Doubled, depths that vary by 1.4 times as much count as
one."""

# reset_clears

NOTABLE_FORCE_SHARE = 1e-6
"""Share by which the forces of two runs differ in size, and not in single ticks alone. *Chosen*, for words alone:
doubled, no verdict changes, and a message names the force a little later."""

# centripetal_force

SLOWER_SPEEDS = (0.5, 0.75)
"""The experiment is run at these shares of its speed too, so that the error's growth with v^2 can be seen.

*Chosen*: of an error that grows with v^2 they leave a quarter and 56 per cent. Doubled, the tool would be faster than
the case says."""

STANDARD_ERRORS = 2.0
"""Standard errors of a fit within which a share is not told from its bound. *Chosen*: chance goes farther once in
twenty. Doubled, more runs are undecided, and chance goes farther once in sixteen thousand."""

LEAST_CENTRIPETAL = 1e-12
"""Surface error, m, below which a missing centripetal force costs nothing: rounding of doubles alone.

*Chosen*; doubled, a tool that slides at 0.03 mm/s over a curvature of 1 /m, held by 500 N/m a kg, is not asked any
more."""

EXPLAINING_PUSH = 1e-6
"""Share of the centripetal cost by which the push has to vary to be a column of the regression: less would spoil its
rank. *Chosen*; doubled, a push of one to two millionths is left out."""

REGRESSION_RANK = 1e-10
"""Singular values of the regression below this share of the largest count as zero. *Chosen*, far above rounding:
doubled, columns that are twice as far from being dependent leave the share unknown."""

BLOCK_TICKS = 50.0
"""Ticks whose residuals count as one independent sample, since those of one oscillation hang together. *Chosen*: 50 ms
at 1 kHz, in which the usual dynamics (22 1/s) fade to a third. Doubled, standard errors are larger by 1.4."""

START_DECAY = 100.0
"""Factor to which the assigned dynamics fade before a contact counts as under way. *Chosen*: doubled, 15 per cent more
of a run's beginning are left out."""

LONG_RUN_STARTS = 2.0
"""Times that `START_DECAY` takes that a contact has to last, for its beginning to be left out. *Chosen*: half is left.
Doubled, contacts of two to four such times are judged with their beginning."""

# closed_form, output_invariance

EXTRAPOLATION_ROUNDING = 1e-10
"""Share of a length, of the path travelled or of the model's size, by which rounding may make an extrapolated place
differ. *Chosen*, four hundred thousand roundings of a double: doubled, twice as much is granted."""

# closed_form

FORM_TOLERANCE = 1e-3
"""Share of the path travelled above which a tolerance compares nothing. *Chosen*: doubled, a law whose motion is known
to two thousandths is judged."""

EXTRAPOLATED_HALVINGS = 3
"""Times that the tick is halved to extrapolate a motion to a tick of no length. *Chosen*: errors of first to third
order go, by runs of up to eight times the rate. Doubled, runs take eight times as long."""

# comes_to_rest, constraint_stability

EARLY_SHARE, LATE_SHARE = 0.25, 0.5
"""Shares of the quiet time at which the window to compare with, and the last one, begin. Derived: time doubles from one
window to the next, which is what `RETURN_RATIO` supposes. Doubled, nothing is left to compare."""

QUIET_SAMPLES = 8
"""Samples that a verdict takes at least. *Chosen*: doubled, runs of up to 15 samples are undecided."""

RETURN_RATIO = math.sqrt(0.5)
"""Ratio of the last window's largest value to that of the window before, up to which a motion dies out.

Derived: while time doubles, what stays has 1 and what falls as 1 / t has 1/2; this is their geometric mean. Doubled, a
distance that grows by 41 per cent counts as coming home."""

# constraint_stability

GROWS = 1.01
"""Ratio of the distance after to that before from which a swing is said to grow. *Chosen*, for words alone: doubled,
only one that doubles is, and others are called marginal."""

STANDS = 0.5
"""Share of the distance: a tool that varies by less stands off the surface, and one that is off by more to either side
swings about it.

*Chosen*, for words alone: doubled, a decaying tool is said to stand, and no swing is named."""

# constraint_stability, refinement, friction: cone

LENGTH_ROUNDING = 1e-12
"""Share of a length, or of another quantity's largest value, that a sum of doubles may be off: four thousand roundings.
*Chosen*; doubled, twice as much is granted to rounding."""

# contact_kept

TOOL_GRAIN = 0.125
"""Grain of the rigid tool, as a share of the largest HIP step. *Chosen*: the bound is this much wider than what is
granted. Doubled, a quarter of a HIP step is added."""

FINEST_GRAIN, COARSEST_GRAIN = 1e-6, 1e-4
"""Limits of that grain, as shares of the model's size. *Chosen*: doubled, 0.4 um and 40 um of the usual 200 mm."""

MOST_FLIGHTS = 16
"""Flights within one tick, each from where the slide before has ended; each brings the tool nearer to the hand.

*Chosen*, against a search without an end: doubled, nothing changes where a tool is held by fewer faces than that in a
tick."""

# contact_normal_force

STATIC_SHARE = 0.2
"""Share of the run, at its end, over which a static equilibrium is looked for. *Chosen*: doubled, a hand that comes to
rest in the last 40 per cent only is not judged any more."""

ANGLE_ROUNDING = 1e-6
"""Angle, rad, that is granted to every force beside the rounding of positions: its own components are rounded, too.
*Chosen*, eight roundings of single precision: doubled, 1e-4 degrees are granted."""

# continuous_contact

CHORD_STEPS = 0.5
"""HIP steps that a point on the straight line between two contact points lies off the surface at the most.

Derived: half of that line, at an edge; a contact point that is late by no whole number of ticks is such a point.
Doubled, a tool may cut every edge by a HIP step."""

HALF_LAG_STEPS = 0.5 * LAG_TICKS
"""HIP steps of the recording that three ticks at twice its rate are: where a path is looked at, the largest step.
Derived; doubled, hops of three HIP steps are not looked at."""

CONFIRMING_RATES = (2, 4)
"""Sampling rates, times the recorded one, at which the path with a jump that stays has to have it too. *Chosen*: at one
rate alone a jump may be that of the rate. Doubled, runs take twice as long."""

REFINEMENTS = (1, 2, 4, 8, 16, 32)
"""Sampling rates, times the recorded one, of a run that is refined as a whole. *Chosen*: the first three always, the
rest while undecided. Doubled, runs take twice as long and fewer are undecided."""

LEAST_REFINEMENT = 4
"""The one of `REFINEMENTS` up to which every run is refined, for a slope over three jumps. *Chosen*: doubled, runs
whose jump is small at once take twice as long."""

MINI_JUMP_EDGES = 1.5
"""A jump up to this many edges or cells of the renderer's representation is a mini pop-through: between neighbours.

Derived: between neighbours a nearest point jumps by an edge at the most, and rounding of its ends adds half. Doubled, a
jump over one edge is called mini; both fail."""

STILL_STEP_SHARE = 1e-3
"""HIP steps below this share of the largest one are no motion that could be amplified. *Chosen*, for the evidence
alone: doubled, no verdict changes."""

POWER_LAW_SCATTER = math.log2(1.1)
"""How far jumps may scatter about c r^k, in log2: a tenth. *Chosen*; doubled, jumps of a fifth beside it count as that
law."""

JUMP_SLOPE, SHRINKING_SLOPE = 0.15, 0.25
"""Slopes of log2(jump) against log2(step): a jump has 0, a Hoelder map of order a has a, a Lipschitz map 1.

*Chosen* between 0 and the 1/6 of the sharpest tip that is asked for, and above it. Doubled, conformal maps at tips
would fail."""

COARSENINGS = (1, 2, 4)
"""Every sample, every second, every fourth: what a recording offers that cannot be refined. *Chosen*: a recording has
no finer samples. Doubled, the places that are compared are twice as far apart."""

CONFIRMED_SHARE = 0.5
"""Share of a jump that is there at other rates as well, unless it depends on the rate. *Chosen*, for words alone:
doubled, a jump that comes out a little shorter is said to depend on it."""

MEDIAL_BENDING = 0.9
"""Curvature times depth from which a nearest point counts as on the medial axis, where steps are stretched by ten.
*Chosen*, 1 less a tenth: doubled, places behind the centre of curvature are judged, by a stretch that is negative."""

DESCENT_SHARE = 0.1
"""Step of a tool that slides on the surface, as a share of the bound that it is compared with. *Chosen*: its place is
off by a tenth of the bound at the most. Doubled, by a fifth."""

DETOUR_BOUNDS = 2.0
"""Bounds by which a step may be longer over the sliding tool's place than straight.

Derived: a place that is off the line by a bound makes it longer by one there and one back. Doubled, steps may pass two
bounds beside."""

# jumps: steps

FLIGHT_BOUNDS = 2.0 * DETOUR_BOUNDS
"""Bounds beyond which a step may be a flight: both ends of a shorter one lie within `DETOUR_BOUNDS` of one place.

Derived; doubled, flights of four to eight bounds fail as jumps."""

# broken_contact

HELD_FORCE_SHARE = 0.5
"""Share of the usual force on the first face below which the force is not kept any more.

*Chosen*: a spring that is kept has one, a rounded corner takes it to nothing. Doubled, every change of the force on a
face would count as its loss."""

SAME_DEPTH_SHARE = 0.5 * (1.0 - HELD_FORCE_SHARE)
"""Share of the depth by which it may vary where a force counts as given at one depth: half of what it may lose.

Derived from it: a spring's force varies with the depth, and so by no more than half of what would count as its loss.
Doubled, a hand that rises to half its depth could by itself look like a lost force."""

# broken_contact, abrupt_switch, crossings

FACE_TURN_SHARE = 0.05
"""Share of the corner's turn within which a direction counts as a face's: far above rounding, far below a switch.
*Chosen*: doubled, the corner of a conformal map that leaves a tenth of the turn open counts as switched by
`abrupt-switch`, and `broken-contact` lets a force lean from n_pre by a tenth of the turn before the corner."""

# crossings

FACE_SAMPLES_SHARE = 1e-3
"""Share of the position tolerance by which a face may be off in a line of fewer points. *Chosen*, for time: doubled,
two thousandths of the tolerance are lost."""

SAME_NORMAL = 1e-9
"""Cosine's distance from one, or difference of unit vectors, up to which normals are the same but for rounding.

*Chosen*: 1e-9 of a cosine are 45 urad. Doubled, a face that is turned by up to 63 urad counts as the same."""

SHIFTED_TOOLS_APART = 7.0
"""How far apart, in roundings of a length, the tools of a hand a little inside and of one a little outside may be.

A hand that is on the mesh to one rounding is put two inside, and two outside: 4 apart. Inside it is 2 + 1 from the mesh
at most, and so is its tool; outside it is its tool. *Derived*: 3 + 4. Doubled, a tie counts for a face longer."""

BORDER_MISS, BORDER_ROUNDING = 1e-6, 1e-12
"""Share of a step, and length (m), by which its way may miss the edge over which it leaves a face.

*Chosen*, for the rounding of the foot in the face's plane. Doubled, ways count that pass twice as far beside the end of
an edge."""

# force_magnitude

STIFFNESS_FACTOR = 2.0
"""Factor by which a stiffness that is off the scene's fails as a must, where none is declared that varies. *Chosen*:
doubled, a third of the stiffness would be a warning only."""

UNDECLARED_RANGE = ((1.0 + TELLING_SHARE) / STIFFNESS_FACTOR, STIFFNESS_FACTOR * (1.0 - TELLING_SHARE))
"""Shares of the scene's stiffness within which it is not off by `STIFFNESS_FACTOR`: a tenth is not told apart, so that
one who is off by just that much fails. Derived; it doubles with that."""

WIDE_RANGE = 16.0
"""Ratio of the largest to the least declared stiffness beyond which next to nothing of the force's size is asked.

A message says so, and what holding the force may give at the scene's own rate is not known either.

*Chosen*: the square of what is a factor of four. Doubled, a range from 0.2 to 6 counts as one that says something."""

CAUSE_SHARE = 0.5
"""Share of the deviation's spread, or of its variance, from which its cause is named. *Chosen*, for words alone:
doubled, no cause is named."""

# impulsive_collision

WINDOW_TICKS = LAG_TICKS + 1
"""Ticks in which a collision's impulse has to come: a sampled renderer meets the contact at the sample after it, its
answer acts until the next, and may be late.

Derived; doubled, a cushion of seven ticks passes as a collision."""

UNKNOWN_MOMENTUM = 0.5
"""Share of the momentum that the operator may take before the tool is met, beyond which (3.5) says nothing. *Chosen*:
doubled, collisions are judged whose momentum the hand took all."""

SAME_FACE_COSINE = 0.995
"""Cosine, of 5.7 degrees, by which the normal may turn in that time: beyond, (3.5) along one normal says nothing.
*Chosen*: the momentum that it may hide is a tenth (its sine). Doubled as an angle, a fifth."""

IMPULSE_ROUNDING = 1e-6
"""Share of the impulse that rounding of velocities in single precision may hide. *Chosen*, eight roundings: doubled,
two millionths of the momentum may be missing."""

# jumps

LOOKS_BELOW_SINGLE = 2
"""How often a place is looked at beyond what single precision resolves, in 64 sub-steps each time. *Chosen*: doubled, a
jump that is rounded over less is still found, in twice the looks."""

FEW_PARTS, MANY_PARTS = 4, 64
"""Sub-steps of a step in a closer look: in the first two, for much may be steep but smooth; in others at the most.
*Chosen*, for time: doubled, each look takes twice as long."""

ROWS_OF_A_LOOK = 1024
"""Fine steps of one look: what is suspect over a longer stretch is looked at in parts, the worst first. *Chosen*, for
memory: doubled, looks are half as many and twice as long."""

TICKS_AROUND = LAG_TICKS + 1
"""Ticks on either side of a step in which a proxy that moves in every third tick has moved as well. Derived; doubled,
nothing changes for proxies that move in every third tick."""

JUMP_SPREAD_SHARE = 0.9
"""A spread of which finer steps than single precision resolves leave this share or more is a jump's.

*Chosen*: a jump leaves all of it, a map of exponent 1/6 half in 64 sub-steps. Doubled, no spread would be a jump."""

LEAST_EXPONENT = 0.15
"""Exponent from which on a map counts as continuous: 1/6, less a tenth for where the samples fall.

Derived from the tip of 60 degrees; doubled, a conformal map at a tip of less than 54 degrees is steep, which decides
nothing."""

SMOOTH_EXPONENT = 0.5
"""Exponent above which the ways of a map look smooth at last: a Lipschitz map has 1, and no tip more than 1/2. Derived;
doubled, a Lipschitz map beside a steep place is not recognised as such."""

COARSER_THAN_DOUBLE = 2.0**-26
"""Share of the rounding in single precision below which double precision is too coarse for HIP steps. Derived: there
half of the digits of a double are left. Doubled, one halving less is looked at."""

TICKS_BEFORE_JUMP, TICKS_AFTER_JUMP = 512, 64
"""Ticks before and after a jump that are led along once more at a finer rate: half a second in which to get there.
*Chosen*: proxies forget within it. Doubled, looks take twice as long."""

FOLLOWING_TICKS = 8 * TICKS_AROUND
"""Ticks on either side of a step over which it is looked whether the IHIP follows the hand. *Chosen*: most of these
ticks decide it. Doubled, places farther along the path have a say in it."""

LIMIT_SHARE = 0.5
"""Share of the finest spread that its limit has to have for a jump: *chosen*, since of less the extrapolation makes
most. Doubled, a limit below the finest spread would never be a jump."""

# relations

SAME_ANSWER = 1e-12
"""Share of the model's size by which answers may differ beside what is declared and what rounding of the hand changes:
some four thousand roundings of a double, those of an iteration that ends at rounding.

*Chosen*; doubled, twice as much rounding is granted."""

SAME_SIMULATED_ANSWER = 1e-9
"""The same share for a renderer that answers a stimulus whole: its tool has a motion of its own, with events at
instants that it has to find, and in a corner ever more of them, until rounding ends them.

*Chosen*; doubled, twice as much is granted."""

# nudges, texture

NUDGE_SHARE = 0.25
"""The shorter of the two lengths by which the hand is nudged each way, as a share of the longer. *Chosen*: a tie that
the longer nudge leaves on one side the shorter may meet. Doubled, it meets fewer."""

STEEP_FACTOR = 10.0
"""Times that an answer may change by what nudging the hand by its rounding changes it: a few roundings add up.
*Chosen*; doubled, twice as much is granted where answers are steep."""

AMPLIFIED_FACTOR = 10.0
"""Times its nudge by which an answer may change for a row not to count as one on a discontinuity. *Chosen*; doubled,
rows beside a medial axis count that are left out now."""

HAND_ROUNDING = 4.0 * float(np.finfo(np.float64).eps)
"""Share of a coordinate by which the hand of a run that is stated otherwise may be off, and one at rest seem to move in
a tick: four roundings.

*Chosen*: a turn, a shift, a scale and the way back round once each. Doubled, twice as much is granted, and a hand that
creeps by as much counts as at rest."""

# numerical_stability

ANSWER_CHANGE = 1e-9
"""Share of the model's size by which an answer may change beside what rounding of the hand changes. *Chosen*: seven
digits of the usual IHIP step of 0.1 mm at 200 mm are left. Doubled, 0.4 nm are granted."""

FEWEST_DIGITS = 6.0
"""Digits without which nothing is certified, though what is declared explains why they are lost. *Chosen*: single
precision keeps seven, and a rounding is left. Doubled, nothing passes whose hand is 1,000 km from the origin."""

MOVED_TURN, MOVED_SHIFT = 0.7, (1.3, -0.7, 0.9)
"""Angle, rad, by which the scene is turned, and shares of its size by which it is shifted. *Chosen*: no axis falls on
another, and all coordinates change their digits. Doubled, its coordinates are up to twice as large."""

MOVED_SCALE = 7.0
"""Factor by which the scene is made larger, and smaller. *Chosen*: no power of two, which would leave all digits as
they are. Doubled, coordinates are twice as large, and their rounding too."""

SUSPECT_SHARE = 1e-3
"""Share of `ANSWER_CHANGE` up to which answers need no nudges to explain them. *Chosen*, for time: doubled, no verdict
changes."""

# passivity

RIGID_WORK_SHARE = 1e-3
"""Share of force times path that a force across the path may seem to do. *Chosen*: what facets of the sampling do to
the angle of a force. Doubled, a force may seem to work twice as much."""

MOST_LAPS = 100.0
"""Laps that are led on at the most, to spend what may have been stored. *Chosen*, for time: doubled, a store that lasts
for 100 to 200 laps is told from a creation of energy; now it counts as one."""

FINER_RATES = (4, 8, 16)
"""Rates, in base rates, to which the run is refined: to the first, and further only where that does not decide.
*Chosen*, for time: doubled, fewer are undecided."""

# passivity, of one recording alone

DELAY_SHARE = energy_balance.DELAY_SHARE
"""Share of the work that crosses, to and fro, which a loop's delay may give away: that is pi / 2 sin(w tau) at a
frequency w and a delay tau.

Derived: it is 0.1 at 10 Hz and 1 ms, or 2 Hz and 5 ms. Doubled, a renderer passes that gives back a fifth too much."""

REST_SPEED = energy_balance.REST_SPEED
"""Share of its largest speed below which the hand is at rest. *Chosen*: a thousandth of its kinetic energy is left
open. Doubled, four thousandths are."""

REST_WINDOW = energy_balance.REST_WINDOW
"""Seconds over which that speed is taken. *Chosen*, short against a hand's turn and long against a tick: doubled,
rests of up to 20 ms are none."""

FREE_ROWS = energy_balance.FREE_ROWS
"""Rows without any force that are free space, and no passage through zero. *Chosen*: doubled, a hand that is free for
20 to 39 rows at a time bounds nothing."""

NOISE_DEVIATIONS = energy_balance.NOISE_DEVIATIONS
"""Standard deviations of the force's noise that are left open. *Chosen*: chance goes beyond five once in some three
million. Doubled, twice as much noise is left open."""

MOST_RESTS = energy_balance.MOST_RESTS
"""Rests, spread over a recording, of which each two are compared. *Chosen*, for time: doubled, there are four times as
many pairs."""

# refinement

SETTLING_RATIO = 0.75
"""Ratio to the difference before up to which the difference that halving the tick makes shows an effect of sampling.

Derived: a first-order effect has 1/2, a second-order one 1/4; the middle between 1/2 and 1. Doubled, what grows with
finer ticks is extrapolated."""

# decoupling

DIED_OUT_SHARE = 0.05
"""Share of the largest distance below which the motion across counts as over. *Chosen*: a law that is twice as fast has
it no later. Doubled, a fault in the last tenth of the path home is not seen."""

# surface_motion

FOCAL_EIGENVALUE = 1e-9
"""The least eigenvalue of I + n W at which a foot is told from its neighbours. *Chosen*, as rounding of the foot:
doubled, the same recordings are judged."""

CONSTRAINT_DISTANCE = 1e-3
"""Distance from the surface, m, that a sliding tool may have. *Chosen*: what fingers tell of two lengths of 10 to 20 mm
at the best, and half a percent of the usual 200 mm. Doubled, an error of position that any hand feels passes."""

STOPPED_SHARE = 0.1
"""Share of the model's size within which a tool that stops is not compared with others: 20 mm of 200 mm. *Chosen*:
doubled, one that friction stops after a third of a radius is left out, too."""

SLIDE_SHARE = 1e-3
"""Share of the model's size that a tool must have slid at its top speed for its sliding to be judged. *Chosen*:
doubled, a tool that slides 0.3 mm on 200 mm is not judged."""

# update_rate

FEWEST_CHANGING_TICKS = 20
"""Ticks that call for another force without which no rate is told. *Chosen*: 20 ms at 1 kHz hold a renewal of a loop of
60 Hz. Doubled, touches of 20 to 40 ms are undecided."""

STALE_TICKS = 1.5
"""Ticks for which a force stands at the most while another is called for: one, and half of one, to which a median of
whole ticks is known. Derived; doubled, a loop at half of the rate passes."""

# stiffness

FEWEST_FORCES = 4
"""Different forces without which none contradicts that it is a multiple of a quantum. *Chosen*, as few as show a
lattice: doubled, a declared resolution is believed of touches with four to seven different forces."""

# force_magnitude, of two runs

TWO_FORCES_ROWS = 2 * LAG_TICKS + 1
"""Rows, of twice as many in a row, in which one HIP has two forces where a stiffness varies with more than the place.

Derived: where it leaps at a place, forces that come up to three ticks late differ in three rows from either side.
Doubled, touches of 14 to 27 ticks are not judged."""

# under_the_hand

ASIDE_DEPTHS = 10.0
"""Depths that an IHIP may stand aside of the HIP's nearest surface point.

*Chosen*: a projection whose lines meet the surface under 6 degrees still passes; doubled, under 3. Nearest points and
god-objects have 0 as long as no medial axis is passed.

Rays from a centre have the tangent of their angle to the normal: 2.4 on an ellipse of 5 to 1, 5.6 in a niche. What
stays behind shows where the hand leaves, for there the depth goes to 0."""

STRETCHED_STEPS = 2.0
"""HIP steps up to which a step of the nearest point, which has 1 / (1 - kappa d) of them, is no jump.

*Chosen*: beyond, the hand passes the medial axis, or comes close, and a god-object is right to stay where it was.
Doubled, more is judged."""

# friction: cone, break-away, sliding

COORDINATE_ROUNDINGS = 16.0
"""Roundings of the largest coordinate by which an IHIP at rest may seem to move, and a force that is made of it may be
off.

*Chosen*: a place on a curve is a number along it, and off by up to 8; the force is made of two. Doubled, twice as much
is granted."""

# friction: break-away

BETWEEN_CONES = 0.5
"""Share of what lies between the static and the kinetic cone to which a break-away is known where it is judged.

*Chosen*: it is then nearer to one of them. Doubled, a tool that breaks away on the kinetic cone may pass."""

# friction: sticking, break-away

STICKING_SHARE = 0.6
"""Share of the kinetic cone within which no friction slides, however it goes from sliding to sticking.

*Chosen*, the share at which a scene's tool sticks again unless it says another. Doubled, a tool that slides, rightly,
on the kinetic cone counts as held, and creeps."""

CREEP_SPEED = 1e-7
"""How fast a tool that sticks may creep, m/s: 1 um in 10 s, the resolution of a good encoder.

*Chosen*: a friction that needs a speed to have a force creeps a thousand times as fast. Doubled, 2 um in 10 s pass."""

STICKING_TIME = 1.0
"""Seconds that a tool must be held for, to tell a creep from the bending of a soft contact. *Chosen*: doubled, tools
that are held for one to two seconds are undecided."""

# friction: energy

STEEPER_THAN_SPRING = 1.001
"""Stiffness, in the scene's, from which on a law is steeper across the surface than its spring.

*Chosen*, a thousandth above what rounding makes of the spring itself. Doubled, a law of up to twice the stiffness is
granted nothing for being held, and may fail for it."""

# friction: sliding

SLIDING_TICKS = 10
"""Ticks of sliding without which nothing is shown. *Chosen*: doubled, a tool that slides in 10 to 19 is undecided."""

# friction: work, force

LAP_WORK = 1e-3
"""Share of the work by which a lap may be off: a tenth of a per cent. *Chosen*: doubled, a friction that takes two
thousandths too much passes."""

BRISTLE_PARTS = 8
"""Parts of a tick over which the bristles' speed is taken to go straight from one sample to the next.

*Chosen*: held in the middle of a part it is off by the square of its length. Doubled, the law is known four times as
well, and what the sampling leaves open, which is its difference from whole ticks, stays."""

SLIP_WORK = 1e-9
"""Work, J, of a lap under which nothing slips: a micronewton over a millimetre. *Chosen*: doubled, laps in which the
friction takes 1 to 2 nJ are not judged."""

# effects_order

TOLD_APART = 10.0
"""Times what rounding leaves open that an effect has to add, for its order to be seen. *Chosen*, the inverse of
`TELLING_SHARE`: doubled, effects of up to twenty times rounding are undecided."""

# lag

BETWEEN_TICKS = 0.5
"""Share of the widest second difference by which a value between two ticks may be off the straight line between them.

Derived: an eighth for a parabola; where a contact begins between them a quarter of the change of slope, half of which
at least is in one second difference. Doubled, twice as much is granted for a lag between ticks."""

WHOLE_LAG = 1e-6
"""Ticks by which a lag may be found off a whole number: `least_misfit` is done at 2e-9, and rounding has its share.

*Chosen* between: doubled, nothing changes but for a lag that is by one to two millionths no whole one."""

# shading

OTHER_WEIGHTS = 2.0
"""Times what our shaded normals turn in a tick that a force may turn.

Derived: vertex normals of other weights turn along a facet by all that its two edges turn, ours by half of that.
Doubled, a force that leaps by four times what ours turns in a tick passes."""

# texture

STEADY_SHARE = 0.01
"""Share by which speed and force may differ within a stretch: less than a tenth of a decibel in texture models.
*Chosen*: doubled, less than a fifth, and a hand that is half as steady is judged."""

WHOLE_SAMPLE = 0.01
"""Ticks by which a sample of the texture may be off a whole number of them. *Chosen*: a hundred samples later one is
missed. Doubled, recordings are judged in which that is after fifty."""

TEXTURE_SETTLES = 0.25
"""Seconds that vibrations have to settle: sixteen time constants of a low-pass at 10 Hz. *Chosen*: doubled, steady
stretches and rests of up to half a second are not judged, and of a hand at rest less is allowed."""

SLOWEST_LOW_PASS = 10.0
"""Slowest low-pass (Hz) of the speed that is granted: *chosen*, half of the texture's own 20 Hz. Doubled, nothing
changes where filters ring for longer than that, as those of the suite do."""

WELCH_WINDOW = 256
"""Samples of a window of Welch's estimate; half of them are shared with the next.

*Chosen*, 4 Hz at 1 kHz: doubled, the spectrum is known twice as finely, and of a stretch of 10 s to .85 dB rather than
.63."""

CLEAR_DECIBELS = 1.0
"""Decibels that a check has to tell apart: a stretch so short that chance makes as much decides nothing. *Chosen*:
doubled, 1.2 s at 1 kHz decide, where it takes 4.1 s."""

POWER_PARTS = 8
"""Parts of a stretch whose power is compared, each at least a window long. *Chosen*: doubled, chance makes 1.4 times as
much of a part and more, and stretches of 2 to 4 s at 1 kHz are undecided."""

APART_DECIBELS = 3.0
"""Decibels by which stretches are to differ, to tell whether the amplitude follows speed and force. *Chosen*, half of
the power: doubled, stretches of three quarters less are asked for."""

SHORTEST_STRETCH = 1.5
"""Seconds of a stretch, settled, from which its power is compared with that of others. *Chosen*: doubled, those of 1.5
to 3 s are left out."""

CHANCE_OF_FAILURE = 1e-3
"""Probability with which a right texture exceeds a bound by chance. *Chosen*: doubled, one run in five hundred fails a
right one."""

# texture_work

LOOP_KNOWN = 1e-3
"""Share of the work that crosses in a lap up to which what is open of it may stay so. *Chosen*: doubled, a lap passes
that may give the hand two thousandths of that."""

# transient

IMPULSE_CLOSE = 1e-9
"""Share by which an impulse, and a force at its cap, may be off. *Chosen*, far above rounding, and what a vibration
still has to give after 21 decay times. Doubled, twice as much is granted."""

IMPULSE_DECAYS = 21.0
"""Decay times after which a vibration has given its impulse but for `IMPULSE_CLOSE` of it: e^-21 = 7.6e-10. Derived;
doubled, contacts of 21 to 42 decay times are not judged."""

LATE_START = 1
"""Ticks after the one in which a contact begins, in which what it starts may begin: a renderer may find it in a tick
and answer in the next, and the first sample of a sinusoid is zero.

Derived; doubled, a start two ticks late passes."""

# vibration

CONFIDENCE_WIDTHS = 2.5758293035489004
"""Standard deviations to either side that hold 99 per cent of a normal distribution: the true number lies within what a
fit leaves open with that probability.

*Chosen*: doubled, twice as much is open, and chance goes beyond it once in four million."""

SENSOR_NOISE = 1e-3
"""Least noise of a force, as a share of its peak: what a sensor leaves. *Chosen*: doubled, twice as much is open of a
vibration that is fitted exactly."""
