//! Worlds in which agents make visits.

use bevy::prelude::*;
use bevy_playbot::{control::Control, headless::tick_world, panics::PanicReports, vision::VisionError};
use playbot_learner::Streams;

use super::{
    archive::Archive,
    error::ExploreError,
    job::Job,
    lookout::Lookout,
    plan::ExplorePlan,
    visit::{Draws, Visit, Visited},
};
use crate::{ended_episodes::EndedEpisodes, game::Game, worlds::build_observing_world};

/// Some arenas of an exploration.
pub(super) struct ExploreWorld<'a> {
    game: &'a dyn Game,
    mode: &'a str,
    level: u64,
    world: World,
    agents: Vec<Entity>,
    draws: Draws,
    lookout: Lookout<'a>,
}

impl<'a> ExploreWorld<'a> {
    /// Builds agents `first..first + count`, all idle.
    ///
    /// # Errors
    ///
    /// The observation of the explorer's policy cannot be drawn.
    pub fn new(
        game: &'a dyn Game,
        plan: &'a ExplorePlan,
        lookout: Lookout<'a>,
        first: u32,
        count: u32,
    ) -> Result<Self, VisionError> {
        let (mut world, agents) = build_observing_world(game, &plan.mode, &plan.observation_config, 0, first, count)?;
        EndedEpisodes::note_in(&mut world);
        if let Some(mut reports) = world.get_resource_mut::<PanicReports>().filter(|_| !plan.keeps_panics) {
            reports.keep_no_files();
        }
        plan.explorer.install(&mut world);
        let draws = Draws {
            streams: Streams::new(plan.seed),
            sticky: plan.sticky,
            is_policy: plan.explorer.is_policy(),
            space: game.actions(),
        };
        Ok(Self { game, mode: &plan.mode, level: plan.level, world, agents, draws, lookout })
    }

    /// Returns whether cells are squares of the grid.
    pub fn has_places(&self) -> bool {
        self.lookout.has_places()
    }

    /// Makes visits, several of them at a time. `progress` receives the ticks of each.
    ///
    /// # Errors
    ///
    /// The game broke its contract, or does not replay.
    pub fn play(
        &mut self,
        jobs: Vec<Job>,
        archive: &Archive,
        progress: &impl Fn(u64),
    ) -> Result<Vec<(u64, Visited)>, ExploreError> {
        let mut jobs = jobs.into_iter();
        let mut visits: Vec<Option<Visit>> = self.agents.iter().map(|_| None).collect();
        let mut done = Vec::new();
        loop {
            for (visit, &agent) in visits.iter_mut().zip(&self.agents) {
                let mut entity = self.world.entity_mut(agent);
                if visit.is_none() {
                    *visit = jobs.next().map(|job| Visit::begin(job, self.level, &self.draws, &mut entity));
                }
                match visit {
                    Some(visit) => visit.act(&self.draws, &mut entity),
                    None => {
                        entity.insert(Control::Idle);
                    }
                }
            }
            if visits.iter().all(Option::is_none) {
                return Ok(done);
            }
            tick_world(&mut self.world)?;
            let ended = EndedEpisodes::take(&mut self.world);
            for (visit, &agent) in visits.iter_mut().zip(&self.agents) {
                let Some(running) = visit.as_mut() else { continue };
                let end = ended.iter().find(|(entity, _)| *entity == agent).map(|(_, result)| *result);
                let (game, world, lookout) = (self.game, &self.world, &mut self.lookout);
                let spot = |ticks, before| lookout.spot(game, world, agent, ticks, before);
                let diverged = |divergence| {
                    let mode = self.mode.to_owned();
                    ExploreError::Diverged { game: game.name(), mode, divergence }
                };
                let is_over = running.note(world, agent, end, archive, spot).map_err(diverged)?;
                if let Some(visit) = visit.take_if(|_| is_over) {
                    let (number, visited) = visit.finish();
                    progress(visited.steps);
                    done.push((number, visited));
                }
            }
        }
    }
}
