//! Maps of where agents went in a level, as in results.

use serde::{Deserialize, Serialize};

/// Ticks by squares of a level, of all episodes of all testers.
///
/// A square is a tile of the level, or several of them in levels of more than 64. Squares are counted row by row from
/// the lower left corner, from 0. Lists have pairs of a square and its value, in the order of the squares.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LevelMaps {
    /// Lower left corner, in the units of the floor plan.
    pub x: f32,
    /// Lower left corner.
    pub y: f32,
    /// Side of a square.
    pub side: f32,
    /// Squares in a row.
    pub columns: u64,
    /// Rows.
    pub rows: u64,
    /// Ticks that agents were there. An open square that an episode only passes between two ticks counts one.
    pub visits: Vec<[u64; 2]>,
    /// Lost ticks: those more than two seconds after the agent last entered a square that was new in its episode. It
    /// rested, or went back and forth.
    pub lost: Vec<[u64; 2]>,
    /// Skills that were active, the most frequent first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub skills: Vec<SkillTicks>,
    /// The skill that was active for most ticks in a square, as an index of `skills`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub skill_at: Vec<[u64; 2]>,
    /// The path of an episode that failed, or that has a finding.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<FailureWay>,
}

/// Ticks of a skill.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SkillTicks {
    /// Its name: the number of z that is furthest from 0, counted from 1, and its sign, such as `z3+`. Only the first
    /// 16 numbers count.
    pub skill: String,
    /// Ticks.
    pub ticks: u64,
}

/// The path of one episode.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FailureWay {
    /// The tester.
    pub tester: String,
    /// Episode of that tester on the level, from 0.
    pub episode: u32,
    /// Squares in order, with the ticks spent in each; of a long path the last 200.
    pub way: Vec<[u64; 2]>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_read_back_as_they_are_written() {
        let maps = LevelMaps {
            x: -0.5,
            y: 0.1,
            side: 1.0,
            columns: 64,
            rows: 13,
            visits: vec![[3, 70], [4, 1]],
            lost: vec![[3, 9]],
            ..LevelMaps::default()
        };
        let text = serde_json::to_string(&maps).expect("serialises");
        let expected = r#"{"x":-0.5,"y":0.1,"side":1.0,"columns":64,"rows":13,"visits":[[3,70],[4,1]],"lost":[[3,9]]}"#;
        assert_eq!(text, expected);
        let failure = Some(FailureWay { tester: "random".to_owned(), episode: 1, way: vec![[3, 70], [4, 1]] });
        let skills = vec![SkillTicks { skill: "z1+".to_owned(), ticks: 71 }];
        let full = LevelMaps { skills, skill_at: vec![[3, 0], [4, 0]], failure, ..maps };
        let text = serde_json::to_string(&full).expect("serialises");
        assert_eq!(serde_json::from_str::<LevelMaps>(&text).expect("whole"), full);
    }
}
