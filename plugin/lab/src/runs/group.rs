//! Groups of runs that differ only in their seed.

use std::collections::BTreeMap;

use super::{record::RunRecord, settings::settings};

/// Largest number of differing settings that a group's label spells out.
const NAMED: usize = 3;

/// Key of a group's skill models among its settings.
const SKILLS: &str = "skills";

/// Runs of the same experiment and algorithm with several seeds.
#[derive(Clone, Debug)]
pub struct RunGroup<'a> {
    /// Label of the group: the algorithm and the settings that differ from other groups, such as `ppo lr=0.001`.
    pub label: String,
    /// The settings in which the groups differ, with this group's values.
    pub differing: BTreeMap<String, String>,
    /// The runs, in the order of their seeds.
    pub runs: Vec<&'a RunRecord>,
}

impl RunGroup<'_> {
    /// Returns the seeds, ascending.
    pub fn seeds(&self) -> Vec<u64> {
        self.runs.iter().map(|run| run.info.seed).collect()
    }

    /// Returns the facts that make the runs less comparable: repeated seeds, unfinished runs, other revisions of
    /// playbot, other devices, other skill models.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        let first = &self.runs[0];
        if self.seeds().windows(2).any(|pair| pair[0] == pair[1]) {
            warnings.push(format!("{}: the same seed more than once", self.label));
        }
        if self.runs.iter().any(|run| run.curves.last_step() != first.curves.last_step()) {
            let steps: Vec<String> = self.runs.iter().map(|run| run.curves.last_step().to_string()).collect();
            warnings.push(format!("{}: runs of different length ({} steps)", self.label, steps.join(", ")));
        } else if !first.is_finished() {
            warnings.push(format!("{}: not finished", self.label));
        }
        if self.runs.iter().any(|run| run.info.revision != first.info.revision) {
            warnings.push(format!("{}: made by different revisions of playbot", self.label));
        }
        if self.runs.iter().any(|run| run.info.device != first.info.device) {
            warnings.push(format!("{}: made on different devices", self.label));
        }
        if let Some(skills) = self.differing.get(SKILLS) {
            warnings.push(format!(
                "{}: other runs with the same settings and a seed in common had another skill model than {skills}; they \
                 are kept apart",
                self.label
            ));
        }
        warnings
    }
}

/// A group under construction: the settings of its runs, and the runs.
type Members<'a> = (BTreeMap<String, String>, Vec<&'a RunRecord>);

/// Groups runs that differ only in their seed; groups are in the order of their first run.
///
/// Runs with different seeds may have different skill models, as in a study. Runs of the same seed with different
/// skill models are not repetitions. They form separate groups, distinguished by their `skills`.
pub fn group_runs(runs: &[RunRecord]) -> Vec<RunGroup<'_>> {
    let mut groups: Vec<Members> = Vec::new();
    for run in runs {
        let mut key = settings(&run.experiment);
        key.remove("seed");
        key.insert("algorithm".to_owned(), run.info.algorithm.name().to_owned());
        match group_of(&groups, &key, run) {
            Some(index) => groups[index].1.push(run),
            None => groups.push((key, vec![run])),
        }
    }
    name_skills(&mut groups);
    let differs = |key: &String| groups.iter().any(|(other, _)| other.get(key) != groups[0].0.get(key));
    let keys: Vec<String> = groups.iter().flat_map(|(key, _)| key.keys()).filter(|key| differs(key)).cloned().collect();
    let mut finished = Vec::new();
    for (index, (key, mut members)) in groups.into_iter().enumerate() {
        members.sort_by_key(|run| run.info.seed);
        let mut differing: BTreeMap<String, String> = key.into_iter().filter(|(key, _)| keys.contains(key)).collect();
        differing.remove("algorithm");
        let label = label(members[0].info.algorithm.name(), &differing, index + 1);
        finished.push(RunGroup { label, differing, runs: members });
    }
    finished
}

/// Returns the group of a run: the one with its skill model, else the first one whose runs of this seed have no
/// other.
fn group_of(groups: &[Members], key: &BTreeMap<String, String>, run: &RunRecord) -> Option<usize> {
    let fits = |members: &[&RunRecord]| {
        members.iter().all(|other| other.info.seed != run.info.seed || other.info.skills == run.info.skills)
    };
    let shares = |members: &[&RunRecord]| members.iter().any(|other| other.info.skills == run.info.skills);
    let mut fitting = (0..groups.len()).filter(|&index| groups[index].0 == *key && fits(&groups[index].1));
    fitting.clone().find(|&index| shares(&groups[index].1)).or_else(|| fitting.next())
}

/// Adds the skill models to the settings of groups that differ in nothing else.
fn name_skills(groups: &mut [Members]) {
    let keys: Vec<_> = groups.iter().map(|(key, _)| key.clone()).collect();
    for (key, members) in groups {
        if keys.iter().filter(|other| *other == key).count() > 1 {
            let mut skills: Vec<&str> = Vec::new();
            for run in members {
                let name = run.info.skills.as_deref().unwrap_or("unknown");
                if !skills.contains(&name) {
                    skills.push(name);
                }
            }
            key.insert(SKILLS.to_owned(), skills.join(","));
        }
    }
}

fn label(algorithm: &str, differing: &BTreeMap<String, String>, number: usize) -> String {
    if differing.len() > NAMED {
        return format!("{algorithm} #{number}");
    }
    let settings = differing.iter().map(|(key, value)| format!(" {key}={value}"));
    std::iter::once(algorithm.to_owned()).chain(settings).collect()
}

#[cfg(test)]
pub(super) mod tests {
    use playbot_learner::DeviceKind;

    use super::{
        super::{curves::RunCurves, settings::tests::experiment},
        *,
    };
    use crate::train::{Algorithm, run_dir::RunInfo};

    pub fn run(algorithm: Algorithm, seed: u64, changes: &str) -> RunRecord {
        let experiment = experiment(&format!("seed: {seed}, {changes}"));
        let (version, revision) = ("1".into(), "r".into());
        let info = RunInfo {
            algorithm,
            seed,
            version,
            revision,
            game_version: 1,
            skills: None,
            seen: None,
            device: DeviceKind::Flex,
        };
        let path = format!("{algorithm}-{seed}").into();
        RunRecord {
            path,
            experiment,
            info,
            curves: RunCurves::default(),
            checkpoints: Vec::new(),
            is_training: false,
            updated: None,
        }
    }

    fn grouped(runs: &[RunRecord]) -> Vec<(String, Vec<u64>)> {
        group_runs(runs).iter().map(|group| (group.label.clone(), group.seeds())).collect()
    }

    #[test]
    fn seeds_of_one_experiment_are_a_group() {
        let runs = [
            run(Algorithm::Ppo, 2, ""),
            run(Algorithm::ScorePpo, 1, ""),
            run(Algorithm::Ppo, 1, ""),
            run(Algorithm::ScorePpo, 2, ""),
        ];
        assert_eq!(grouped(&runs), [("ppo".to_owned(), vec![1, 2]), ("score-ppo".to_owned(), vec![1, 2])]);
        assert!(grouped(&[]).is_empty());
    }

    #[test]
    fn groups_are_named_by_what_sets_them_apart() {
        let runs = [run(Algorithm::Ppo, 1, "ppo: (gamma: 0.5)"), run(Algorithm::Ppo, 1, "ppo: (gamma: 0.25)")];
        assert_eq!(
            grouped(&runs).iter().map(|(label, _)| label).collect::<Vec<_>>(),
            ["ppo ppo.gamma=0.5", "ppo ppo.gamma=0.25"]
        );
        let many = run(Algorithm::Ppo, 1, "arenas: 8, worlds: 1, ppo: (gamma: 0.75), score: (horizon: 3)");
        let runs = [runs[0].clone(), many];
        let groups = group_runs(&runs);
        assert_eq!((groups[0].label.as_str(), groups[1].label.as_str()), ("ppo #1", "ppo #2"));
        assert_eq!((groups[0].differing["arenas"].as_str(), groups[1].differing["arenas"].as_str()), ("64", "8"));
        assert_eq!(groups[1].differing.len(), 4);
    }

    #[test]
    fn another_skill_model_is_no_other_seed() {
        let with = |seed, skills: &str| {
            let mut run = run(Algorithm::ScorePpo, seed, "");
            run.info.skills = Some(skills.to_owned());
            run
        };
        let study = [with(1, "a"), with(2, "b")];
        assert_eq!(grouped(&study), [("score-ppo".to_owned(), vec![1, 2])], "each seed has a model of its own");
        let runs = [with(1, "a"), with(1, "b"), with(2, "b"), with(2, "a"), with(3, "c")];
        let expected =
            [("score-ppo skills=a,c".to_owned(), vec![1, 2, 3]), ("score-ppo skills=b".to_owned(), vec![1, 2])];
        assert_eq!(grouped(&runs), expected);
        for group in group_runs(&runs) {
            assert!(group.warnings().iter().any(|warning| warning.contains("another skill model")));
        }
        let mut other = [with(1, "a"), with(2, "a")];
        other[1].info.device = DeviceKind::Ndarray;
        let warnings = group_runs(&other)[0].warnings().join("\n");
        assert!(warnings.contains("devices") && !warnings.contains("skill"), "{warnings}");
    }

    #[test]
    fn doubtful_groups_are_pointed_out() {
        let mut runs = [run(Algorithm::Ppo, 1, ""), run(Algorithm::Ppo, 1, "")];
        runs[1].info.revision = "other".into();
        let warnings = group_runs(&runs)[0].warnings().join("\n");
        assert!(warnings.contains("same seed") && warnings.contains("not finished"), "{warnings}");
        assert!(warnings.contains("revisions"), "{warnings}");
    }
}
