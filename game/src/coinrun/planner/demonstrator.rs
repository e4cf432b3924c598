//! A player that follows plans and makes a new one after each disturbance.

use crate::coinrun::{
    planner::{PlannerConfig, plan_or_progress, search::Found},
    sim::Sim,
};

/// An actor in a closed loop: ask it for an action, play that action or another one, ask again.
#[derive(Clone, Debug)]
pub struct Demonstrator {
    config: PlannerConfig,
    /// Actions still to be played, the next one last.
    actions: Vec<u8>,
    /// The state in which the next planned action is right.
    expected: Option<u64>,
    /// It is proved that nothing leads to the coin from the state of the last plan.
    is_hopeless: bool,
    replans: u64,
}

impl Default for Demonstrator {
    fn default() -> Self {
        Self::new(PlannerConfig::cautious())
    }
}

impl Demonstrator {
    /// Returns a demonstrator that plans with these settings.
    pub fn new(config: PlannerConfig) -> Self {
        Self { config, actions: Vec::new(), expected: None, is_hopeless: false, replans: 0 }
    }

    /// Returns the action (0 to 14) for the state of `sim`. A state that does not follow from the last action that was
    /// given, or belongs to another episode, leads to a new plan.
    pub fn act(&mut self, sim: &Sim) -> u8 {
        let has_plan = !self.actions.is_empty() || self.is_hopeless;
        if !has_plan || self.expected != Some(sim.state_hash()) {
            self.replan(sim);
        }
        // Without any path forward, waiting is as good as anything.
        let action = self.actions.pop().unwrap_or(4);
        let mut next = sim.clone();
        next.step(action);
        self.expected = Some(next.state_hash());
        action
    }

    /// Returns the number of plans made so far.
    pub fn replans(&self) -> u64 {
        self.replans
    }

    fn replan(&mut self, sim: &Sim) {
        self.replans += 1;
        let (found, _) = plan_or_progress(sim, &self.config);
        // Otherwise every tick would be searched again to the end.
        self.is_hopeless = matches!(found, Found::Hopeless(_));
        let (Found::Coin(mut actions) | Found::Progress(mut actions) | Found::Hopeless(mut actions)) = found;
        actions.reverse();
        self.actions = actions;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    use crate::coinrun::generator::generate;
    use crate::coinrun::level::{Level, Mode};

    #[test]
    fn an_undisturbed_plan_is_made_once() {
        let mut sim = Sim::new(Arc::new(generate(Mode::Hard, 1)));
        let mut demonstrator = Demonstrator::default();
        while sim.end().is_none() {
            sim.step(demonstrator.act(&sim));
        }
        assert!(sim.end().is_some_and(|end| end.is_success()));
        assert_eq!(demonstrator.replans(), 1);
    }

    #[test]
    fn a_level_that_is_proved_unsolvable_is_planned_once() {
        let tower = "#...#.....#\n".repeat(29);
        let text = format!("#.........#\n{tower}#A..#....C#\n#=========#\n");
        let mut sim = Sim::new(Arc::new(Level::from_text(&text).expect("a valid picture")));
        let mut demonstrator = Demonstrator::default();
        while sim.end().is_none() {
            sim.step(demonstrator.act(&sim));
        }
        assert!(sim.end().is_some_and(|end| !end.is_success()));
        assert_eq!(demonstrator.replans(), 1);
    }

    #[test]
    fn a_disturbance_or_another_level_leads_to_a_new_plan() {
        let mut sim = Sim::new(Arc::new(generate(Mode::Hard, 1)));
        let mut demonstrator = Demonstrator::default();
        demonstrator.act(&sim);
        sim.step(1);
        demonstrator.act(&sim);
        assert_eq!(demonstrator.replans(), 2);
        let other = Sim::new(Arc::new(generate(Mode::Hard, 2)));
        demonstrator.act(&other);
        assert_eq!(demonstrator.replans(), 3);
    }
}
