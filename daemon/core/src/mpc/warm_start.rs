//! Which rows to expect in the working set: those of the last solved cycle.
//!
//! A row that bounds an instant bounds, a cycle later, the instant that is a cycle closer; so a
//! guess shifts with time. But while the arm presses on steadily, the same rows are active in every
//! cycle, as far ahead as before. Both guesses are tracked, and the one that would have been right
//! more often in the last cycle is used in the next. A wrong guess only costs time. Axes that have
//! joined are not in it, rows of axes that have left are dropped.

use crate::mpc::constraints::{Layout, Row, RowKind};
use crate::mpc::horizon::Horizon;
use crate::mpc::qp::{MAX_VARIABLES, RowState, members_of};
use crate::quantities::Instant;

/// The working set of the last solved problem.
#[derive(Debug, Clone, Copy)]
pub struct WarmStart {
    rows: [(Row, RowState); MAX_VARIABLES],
    len: usize,
    /// The sample that it belongs to.
    stamp: Instant,
    /// Which guess was better last time.
    shifts: bool,
}

impl WarmStart {
    /// Nothing known.
    pub fn empty() -> Self {
        let row = Row { kind: RowKind::Force, component: 0, instant: 0 };
        Self { rows: [(row, RowState::Inactive); MAX_VARIABLES], len: 0, stamp: Instant::default(), shifts: false }
    }

    /// Knows nothing again.
    pub fn forget(&mut self) {
        (self.len, self.shifts) = (0, false);
    }

    /// Writes the guess for the sample stamped `stamp` into `working`.
    pub fn guess<const N: usize, const D: usize>(
        &self,
        layout: &Layout,
        horizon: &Horizon<N, D>,
        stamp: Instant,
        working: &mut [RowState],
    ) {
        working.fill(RowState::Inactive);
        for (row, state) in &self.rows[..self.len] {
            let guessed = if self.shifts { self.shifted(layout, horizon, row, stamp) } else { [Some(*row), None] };
            for number in guessed.iter().flatten().filter_map(|row| layout.number(row)) {
                working[number] = *state;
            }
        }
    }

    /// Where a row stands at `stamp`; the last instant of a kind stays in the guess for the one
    /// that takes its place.
    fn shifted<const N: usize, const D: usize>(
        &self,
        layout: &Layout,
        horizon: &Horizon<N, D>,
        row: &Row,
        stamp: Instant,
    ) -> [Option<Row>; 2] {
        let elapsed = stamp.since(self.stamp).seconds();
        let time = |instant: usize| match row.kind {
            RowKind::Force | RowKind::MinimumForce => horizon.force_points()[instant].time,
            _ => horizon.start_of(instant),
        };
        let target = time(row.instant) - elapsed;
        let mut instant = row.instant;
        while instant > 0 && time(instant - 1) - target > target - time(instant) {
            instant -= 1;
        }
        // Nearer to the instant before the first: dropped.
        let is_gone = instant == 0 && 2.0 * (time(0) - target) > elapsed;
        let stays = row.instant == layout.last_instant(row.kind) && instant != row.instant;
        [(!is_gone).then_some(Row { instant, ..*row }), stays.then_some(*row)]
    }

    /// Remembers the working set of the problem for the sample stamped `stamp`, and which guess
    /// came closer to it.
    pub fn learn<const N: usize, const D: usize>(
        &mut self,
        layout: &Layout,
        horizon: &Horizon<N, D>,
        stamp: Instant,
        working: &[RowState],
    ) {
        if self.is(layout, working) {
            // The same once more: nothing moves.
            (self.stamp, self.shifts) = (stamp, false);
            return;
        }
        // Rows guessed right count for a guess, those guessed wrong against it.
        let (mut same, mut moved) = (0, 0);
        let score = |row: &Row, state: RowState| match layout.number(row) {
            Some(number) if working[number] == state => 1,
            _ => -1,
        };
        for (row, state) in &self.rows[..self.len] {
            same += score(row, *state);
            moved +=
                self.shifted(layout, horizon, row, stamp).iter().flatten().map(|row| score(row, *state)).sum::<i32>();
        }
        if same != moved {
            self.shifts = moved > same;
        }
        self.stamp = stamp;
        self.len = 0;
        let rows = members_of(working).filter_map(|(number, state)| Some((layout.row(number)?, state)));
        for (place, row) in self.rows.iter_mut().zip(rows) {
            *place = row;
            self.len += 1;
        }
    }

    /// Whether `working` is the working set that is remembered.
    fn is(&self, layout: &Layout, working: &[RowState]) -> bool {
        let rows = &self.rows[..self.len];
        let holds = |(row, state): &(Row, RowState)| layout.number(row).is_some_and(|number| working[number] == *state);
        // A checked sum would count one by one.
        let active = working.iter().map(|state| usize::from(*state != RowState::Inactive));
        let count = active.fold(0, usize::wrapping_add);
        count == rows.len() && rows.iter().all(holds)
    }
}
