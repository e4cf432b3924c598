//! Agents in apps of their own: episodes, rewards, recordings, skills, policies and training.

mod assertions;
mod calibration;
mod collecting;
mod corridor_defects;
mod detectors;
mod episodes;
mod explore;
mod faults;
mod findings;
mod lander;
mod leaps;
mod level_detectors;
mod one_world;
mod orders;
mod pipeline;
mod recording;
mod rewards;
mod skills_held;
mod takeover;
mod trails;
mod training;
mod truncation;
mod verdicts;
mod vision;
mod walks;
