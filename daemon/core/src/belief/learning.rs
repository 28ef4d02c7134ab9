//! What the belief learns of a surface of which only a range is told.

use nalgebra::SVector;

use super::surface_set::ShownForce;
use super::{Belief, ContactSign, Settings, SurfaceSet, Way};
use crate::intake::Accepted;
use crate::surface::Surface;

impl<const D: usize> Belief<D> {
    /// The set after a sample, and the surface in it that is likeliest.
    pub(super) fn learn<const N: usize>(&mut self, sample: &Accepted<N, D>, way: Option<&Way>) {
        let Some(set) = &mut self.set else { return };
        let (surface, told) = (&mut self.surface, &self.settings.surface);
        let in_contact = self.contact.is_any();
        // A normal that does not hold any more: all begins anew.
        let way = way.filter(|_| surface.normal == told.normal || in_contact || set.remembers_normal());
        if way.is_none() && surface.normal != told.normal {
            let stiffness = surface.normal_stiffness();
            surface.normal = told.normal;
            surface.become_spring(stiffness, -surface.height(&surface.contact.position));
        }
        let position = &sample.posture.pose().position;
        let depth = -surface.height(position);
        if set.learns_normal() {
            let begins = -surface.height(&told.contact.position);
            let (away, deeper) = ((position - told.contact.position).norm_squared(), depth - begins);
            set.told_at(begins, libm::sqrt((away - deeper * deeper).max(0.0)));
        }
        set.follow(way, depth, &ShownForce::of(sample, surface), in_contact);
        if let Some(tilt) = set.take_tilt() {
            set.shift(surface.tilt(&tilt, position));
        }
        if let Some(spring) = set.likeliest().or(in_contact.then(|| set.unexplained())) {
            surface.become_spring(spring.stiffness, spring.depth);
        }
    }

    /// Begins the contact with a surface that the samples show by the way of the tool, before f̂ is above β: where a tool weighs on
    /// the sensor against the touch, that is a cycle late, in which an arm goes 0.8 mm on at 4 ms and 0.2 m/s. What counts is the force
    /// that the surface shows, which has less noise than f̂ from the second sample on; f̂ has to agree, by both ways of seeing the tool's
    /// motion: one that sets off feigns a touch where q̇ is reported late. Not where the arm `was_in_contact` with the sample before:
    /// this one has just released it.
    pub(super) fn touch_what_was_noticed<const N: usize>(&mut self, sample: &Accepted<N, D>, was_in_contact: bool) {
        let touched = self.set.as_ref().and_then(SurfaceSet::shown_of_touch);
        let Some(shown) = touched.filter(|_| !was_in_contact && !self.contact.is_any()) else { return };
        let Settings { thresholds, sign, .. } = &self.settings;
        let shown = self.surface.normal * -shown;
        let felt = thresholds.where_noticed().beyond(&sample.unsure()).felt(&shown);
        let felt = thresholds.held(&felt, &sample.wrench);
        let felt = thresholds.held(&felt, &sample.wrench_by_position);
        let by_surface = (*sign == ContactSign::Normal).then_some(&self.signs);
        self.contact = self.contact.update(thresholds, &felt, by_surface, &shown);
    }

    /// Whether the normal is learned as well.
    pub(crate) fn learns_normal(&self) -> bool {
        self.set.as_ref().is_some_and(SurfaceSet::learns_normal)
    }

    /// Whether a twist is meant to leave the surface: by the normal that was told, and by the one that
    /// was learned. Along a surface that turns out to be tilted the tool is to slide, and one that
    /// follows a surface uphill does not leave it.
    pub(crate) fn is_left_by(&self, twist: &SVector<f64, D>) -> bool {
        self.settings.surface.is_left_by(twist) && self.surface.is_left_by(twist)
    }

    /// The twist of a stopped arm that moves out of the surface, at `speed` (m/s) at most: by the
    /// normal that was told, and by the one that was learned, since either may be wrong.
    pub(crate) fn retreat_along(&self, twist: &SVector<f64, D>, speed: f64) -> Option<SVector<f64, D>> {
        let by = |surface: &Surface<D>| surface.retreat_along(twist, speed);
        by(&self.surface).filter(|_| by(&self.settings.surface).is_some())
    }

    /// f_min per axis in N: that of the told normal's axes is a force along it, and stays that along
    /// one that is learned. The force along the normal would else have to grow on an axis to which the
    /// normal has less and less of a component.
    pub(crate) fn least_force(&self, told: &SVector<f64, D>) -> SVector<f64, D> {
        let (is, was) = (&self.surface.normal, &self.settings.surface.normal);
        let part = |axis: usize| if is[axis] == was[axis] { 1.0 } else { is[axis].abs() / was[axis].abs() };
        SVector::from_fn(|axis, _| if self.signs.sign(axis).is_some() { told[axis] * part(axis) } else { told[axis] })
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
