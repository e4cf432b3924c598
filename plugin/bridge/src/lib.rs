//! Programs in other languages play Bevy games: the protocol, the arrays and the Worlds that step together.
//!
//! In reading order:
//!
//! - [`arrays`]: the arrays of a step, and the memory that both sides read and write.
//! - [`messages`]: the messages of the protocol.
//! - [`lockstep`]: Worlds whose agents all wait for their next actions.
//! - [`server`]: a conversation with one client.
//! - [`mcp`]: a session of a language model, over the Model Context Protocol.

pub mod arrays;
pub mod lockstep;
pub mod mcp;
pub mod messages;
pub mod server;
