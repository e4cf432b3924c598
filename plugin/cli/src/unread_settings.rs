//! Settings in sections of other algorithms, which change nothing.

use playbot_lab::train::Algorithm;

/// Says which of the `key=value`s none of these algorithms reads: whoever sets them expects something of them.
pub fn tell_unread(whose: &str, sets: &[String], algorithms: &[Algorithm]) {
    for (set, section) in unread(sets, algorithms) {
        let names: Vec<&str> = algorithms.iter().map(|algorithm| algorithm.name()).collect();
        tell!("warning: {whose}{set} changes nothing: {} reads no settings of `{section}`", names.join(" or "));
    }
}

/// Those of sections that none of them reads, with their sections.
fn unread<'a>(sets: &'a [String], algorithms: &[Algorithm]) -> impl Iterator<Item = (&'a str, &'a str)> {
    sets.iter().filter_map(|set| {
        let section = set.split(['.', '=']).next()?.trim();
        let is_read = algorithms.iter().any(|algorithm| algorithm.reads(section));
        (!is_read).then_some((set.as_str(), section))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_of_other_algorithms_are_found() {
        let sets = [
            "ppo.lr=0.1",
            "sac=(batch: 3)",
            "score.kl=false",
            "steps=3",
            "skills.latent=2",
            "spirl.kl_coef=1",
            "rlpd.critics=3",
        ];
        let sets = sets.map(str::to_owned);
        let found =
            |algorithms: &[Algorithm]| unread(&sets, algorithms).map(|(_, section)| section).collect::<Vec<_>>();
        assert_eq!(found(&[Algorithm::Ppo]), ["sac", "score", "skills", "spirl", "rlpd"]);
        assert_eq!(found(&[Algorithm::ScorePpo]), ["sac", "spirl", "rlpd"]);
        assert_eq!(found(&[Algorithm::ScoreSac]), ["ppo", "spirl", "rlpd"]);
        assert_eq!(found(&[Algorithm::SpirlSac]), ["rlpd"]);
        assert_eq!(found(&[Algorithm::Rlpd]), ["ppo", "score", "skills", "spirl"]);
        assert_eq!(found(&[Algorithm::BehaviourCloning]), ["ppo", "sac", "spirl", "rlpd"]);
        assert_eq!(found(&[Algorithm::Ppo, Algorithm::ScoreSac]), ["spirl", "rlpd"]);
        assert_eq!(found(&Algorithm::ALL), [""; 0]);
    }
}
