//! Names of our parameters in the cases.

/// Returns the case's name of our parameter `name`, where the decoder's last layer is called `decoder_head`.
pub fn their_name(name: &str, decoder_head: &str) -> String {
    let name = name
        .replace("encoder.state.head", "enc.state.l2")
        .replace("encoder.", "enc.")
        .replace("decoder.head", decoder_head)
        .replace("decoder.", "dec.")
        .replace("prior.head", "prior.mean")
        .replace("sac_actor.head", "actor.mean")
        .replace("sac_actor.", "actor.")
        .replace("target.q1.", "q1_target.")
        .replace("target.q2.", "q2_target.");
    name.replace("frozen.", "decoder.").replace("gru.uni", "uni").replace("gru.bi", "bi")
}
