//! Tests of agents in apps of their own: episodes, rewards, recordings, skills, policies and training.

mod any_recordings;
mod assertions;
mod calibration;
mod collecting;
mod corridor_defects;
mod cut_skills;
mod detectors;
mod episodes;
mod explore;
mod faults;
mod findings;
mod lander;
mod leaps;
mod lessons;
mod level_detectors;
mod meadow;
mod memories;
mod one_world;
mod orders;
mod paused;
mod pipeline;
mod recorded_players;
mod recorded_rewards;
mod recording;
mod rewards;
mod rivals;
#[cfg(unix)]
mod served;
mod skills_held;
mod takeover;
mod trails;
mod training;
mod truncation;
mod verdicts;
mod vision;
mod walks;
