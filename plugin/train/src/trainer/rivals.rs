//! Rivals of a trainer: their renewal between rollouts, their ratings, and their part of checkpoints.

use crate::{
    checkpoint::CheckpointSummary,
    collect::{Collector, RestoreError},
    error::TrainError,
    rival_seats::ArenaRivals,
    self_play::{SelfPlay, SelfPlayState, Snapshot, ladder::Ladder},
    trainer::Trainer,
};
use std::sync::Arc;

impl Trainer {
    /// Lets the next episodes have the present rivals, the learner as it is at the start being the first of them.
    pub(super) fn renew_rivals(&mut self) {
        let Some(self_play) = &mut self.self_play else { return };
        self_play.begin(&*self.learner);
        let Some(pool) = self_play.pool().map(Arc::new) else { return };
        self.collectors.iter_mut().filter_map(Collector::rivals_mut).for_each(|rivals| rivals.set_pool(&pool));
    }

    /// Notes the results of a rollout against rivals, and adds a snapshot of the policy to them if one is due.
    pub(super) fn rate_rivals(&mut self, before: u64) -> Result<(), TrainError> {
        let (step, is_done) = (self.progress.steps, self.is_done());
        let Some(self_play) = &mut self.self_play else { return Ok(()) };
        let rivals = self.collectors.iter_mut().filter_map(Collector::rivals_mut);
        let (playing, outcomes): (Vec<_>, Vec<_>) = rivals.map(|it| (it.state(), it.take_outcomes())).unzip();
        self_play.note(outcomes.into_iter().flatten());
        self_play.after_update([before, step], is_done, &*self.learner, &playing)
    }

    /// Returns what decides the rivals of each arena; nothing without rivals.
    pub(super) fn arena_rivals(&mut self) -> Vec<ArenaRivals> {
        self.collectors.iter_mut().filter_map(Collector::rivals_mut).map(|it| it.state()).collect()
    }

    /// Goes on with the rivals of the same arenas in other Worlds.
    pub(super) fn set_arena_rivals(&mut self, rivals: Vec<ArenaRivals>) {
        let seats = self.collectors.iter_mut().filter_map(Collector::rivals_mut);
        seats.zip(rivals).for_each(|(seats, state)| seats.set_state(state));
    }

    /// Returns what a checkpoint keeps of a training against rivals.
    pub(crate) fn self_play_state(&mut self) -> Option<SelfPlayState> {
        let arenas = self.arena_rivals();
        self.self_play.as_ref().map(|it| it.state(arenas))
    }

    /// Returns the training against rivals, if it is one.
    pub(crate) fn self_play(&self) -> Option<&SelfPlay> {
        self.self_play.as_ref()
    }

    /// Returns the training results of a checkpoint of this moment.
    pub(crate) fn summary(&self) -> CheckpointSummary {
        let elo = self.self_play.as_ref().and_then(|it| it.rating_at(self.steps()));
        CheckpointSummary { elo, ..self.progress.summary() }
    }

    /// Returns whether the policy of this moment is a snapshot that rivals play.
    pub(crate) fn is_snapshot(&self) -> bool {
        self.self_play.as_ref().is_some_and(|it| it.newest_step() == Some(self.steps()))
    }

    /// Returns the rivals by their ratings; `None` in a training without rivals.
    pub fn ladder(&self) -> Option<Ladder> {
        self.self_play.as_ref().map(SelfPlay::ladder)
    }

    /// Goes on with the rivals of a checkpoint, in a fresh trainer, before its arenas are restored.
    ///
    /// # Errors
    ///
    /// [`RestoreError`] if the checkpoint lacks a rival.
    pub(crate) fn restore_self_play(
        &mut self,
        state: SelfPlayState,
        snapshots: Vec<(usize, Snapshot)>,
    ) -> Result<(), RestoreError> {
        let Some(self_play) = &mut self.self_play else { return Ok(()) };
        let arenas = self_play.restore(state, snapshots);
        let wanted = self.collectors.len();
        if arenas.len() != wanted {
            return Err(RestoreError::Count { saved: arenas.len(), wanted });
        }
        for (collector, state) in self.collectors.iter_mut().zip(arenas) {
            collector.restore_rivals(state, |number| self_play.find(number))?;
        }
        Ok(())
    }
}
