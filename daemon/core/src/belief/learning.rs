//! What the belief learns of a surface of which only a range is told.

use super::{Belief, SurfaceSet, Way};
use crate::intake::Accepted;

impl<const D: usize> Belief<D> {
    /// The set after a sample, and the surface in it that is likeliest.
    pub(super) fn learn<const N: usize>(&mut self, sample: &Accepted<N, D>, way: Option<&Way>) {
        let Some(set) = &mut self.set else { return };
        let surface = &mut self.surface;
        let depth = -surface.height(&sample.posture.pose().position);
        let in_contact = self.contact.is_any();
        set.follow(way, depth, surface.pressing_force(&sample.wrench), in_contact);
        if let Some(spring) = set.likeliest().or(in_contact.then(|| set.unexplained())) {
            surface.become_spring(spring.stiffness, spring.depth);
        }
    }

    /// What the surface may be, where only a range of it is told.
    pub(crate) fn set(&self) -> Option<&SurfaceSet> {
        self.set.as_ref()
    }

    /// Whether the surface is harder than the stiffest that was told.
    pub(crate) fn is_outside_range(&self) -> bool {
        self.set.as_ref().is_some_and(SurfaceSet::is_outside)
    }
}
