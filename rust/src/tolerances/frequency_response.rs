//! Transfer functions: routes, poles, what peaks show.

/// A route of evaluation is taken where it agrees with refined direct solutions this well, or as well as unrefined ones do. Larger: digits
/// are given away. Smaller: the slow route is taken. Pinned by `critical_damping_falls_back_to_hessenberg`, from below. Not seen from
/// above: sums over modes keep 1e-12 or lose far more.
pub const ACCEPTED: f64 = 1e-11;
/// Even where unrefined solutions are worse than this. Larger: routes are taken that lose digits. Smaller: the slow route is taken. Pinned
/// by tests/truth/test_graded_frf.py, from above. Not seen from below: only speed depends on it.
pub const WORST_ACCEPTED: f64 = 1e-9;

/// Up to so many frequencies are solved directly and refined, which keeps every digit of every entry. Larger: time is lost. Smaller: single
/// values have the digits that modes keep.
/// Pinned by `few_frequencies_are_solved_directly`.
pub const FEW: usize = 8;

/// Corrections of a direct solution. Smaller: the digits that other routes are held against are those of a solution without corrections.
/// Larger: time is lost.
pub const REFINEMENTS: usize = 3;

/// Inputs and outputs whose entries are compared one by one; of more, so many, evenly. Larger: the check takes as long as what it checks.
/// Smaller: the entries of many ports are judged by the largest of them.
/// Pinned by `of_many_ports_some_are_compared`.
pub const MOST_PORTS: usize = 12;

/// An entry counts as zero below this part of the geometric mean of what its output and its input move under themselves, and its error with
/// it. Larger: entries of weak couplings may lose their digits. Smaller: couplings of rounding make transfer functions slow.
/// Pinned by `entries_are_compared_over_their_own_size`.
pub const ZERO_ENTRY: f64 = 1e-13;

/// Matrices have a narrow band up to this half-width, over the number of coordinates. Larger: bands are factorised that modes or Hessenberg
/// forms beat. Smaller: chains with many neighbours are solved as full matrices.
/// Pinned by `a_band_is_narrow_up_to_its_bound`.
pub const NARROW: f64 = 1.0 / 16.0;

/// A band is tried before modes up to so many products for each of theirs. Larger: strongly coupled systems take longer than by modes.
/// Smaller: modes are tried in vain, whose check costs as much as some hundred frequencies.
/// Pinned by `bands_go_before_modes_for_several_ports`.
pub const BAND_FIRST: f64 = 2.0;

/// Condition of the vectors of complex modes from which on sums over them are not worth a check, and a sum that is asked for by `modes=` is
/// refused. Larger: sums that lose their digits are tried in vain, and given. Smaller: responses and transfer functions of many ports take
/// slower routes. Pinned by `test_modes_that_nearly_meet_are_no_longer_summed_up`.
pub const WORST_VECTORS: f64 = 1e7;

/// Products of a band in the time in which all modes of a damped system are found, over the cube of the number of coordinates. Larger: very
/// many frequencies of a few ports take longer than by modes. Smaller: modes are found for a few hundred frequencies.
/// Pinned by `modes_are_worth_their_time_for_very_many_frequencies`.
pub const ALL_MODES: f64 = 8.0;

/// The square of half-width and one, over the number of coordinates, up to which poles come from determinants of a band. Larger: wide
/// bands take longer than modes. Smaller: a damped chain takes as long as all its modes.
/// Pinned by `poles_of_narrow_bands_need_no_modes`.
pub const NARROW_ROOTS: f64 = 1.0;

/// Motion times dynamic stiffness over the load from which on a solution without pivots does not judge whether the stiffness is singular.
/// Larger: infinite responses are large numbers. Smaller: time is lost near resonances without damping.
/// Pinned by `near_a_resonance_another_route_answers`.
pub const RESONANT: f64 = 1e12;

/// Relative distance of frequencies to both sides that tell the size of an entry where it passes through zero. Larger: another resonance
/// may be there. Smaller: an antiresonance right at a frequency makes transfer functions slow.
/// Pinned by `entries_are_compared_over_their_own_size`.
pub const BESIDE: f64 = 1e-3;

/// Poles nearer to each other than this, relative, make one peak, and are kept or left out together. Larger: two peaks are told as one.
/// Smaller: conjugates are cut apart.
/// Pinned by `poles_make_one_peak_within_their_bound`.
pub const SAME_POLE: f64 = 1e-9;

/// A peak shows where it exceeds the values beside it by more than this factor. Larger: missed peaks are not told. Smaller: well
/// resolved curves are warned of.
/// Pinned by `a_peak_is_told_where_it_exceeds_its_neighbours`.
pub const SHOWS: f64 = 1.05;

/// Size of a singular direction as an output sees it times as an input drives it, over the sizes of both, below which it is not there.
/// Larger: weakly driven rigid motion is lost. Smaller: rounding makes responses infinite.
/// Pinned by `test_a_free_motion_that_an_output_hardly_sees_is_none`.
pub const UNSEEN: f64 = 1e-10;

/// Damping on a singular direction, over the size of the damping matrix, that is rounding. Larger: weak damping of free motions is lost.
/// Smaller: rounding damps them.
/// Pinned by `test_damping_of_a_free_motion_that_is_rounding_is_none`.
pub const UNRESISTED: f64 = 1e-12;

/// A feedthrough that is a difference of two terms is zero below this part of them. Larger: small feedthroughs are lost. Smaller: strictly
/// proper systems have a feedthrough of rounding. Pinned by `a_feedthrough_that_cancels_but_for_rounding_is_none`.
pub const NO_FEEDTHROUGH: f64 = 1e-10;
