//! The losses of SAC, as pure functions of tensors, `[n]` per row.
//!
//! Continuous and discrete actions share one form. With V = E\[Q - α ln π\], where Q is the least of the critics (or
//! another reduction) and α the temperature, the actor maximises mean(V), and critics learn y = r + γ V'. For
//! continuous actions the expectation is one draw; for discrete ones it is the sum over all choices (Christodoulou
//! 2019, "Soft actor-critic for discrete action settings").

use burn::tensor::Tensor;

/// Returns V of one draw per row: Q - α ln π(a).
pub fn soft_value(log_prob: Tensor<1>, q: Tensor<1>, temperature: f64) -> Tensor<1> {
    q - log_prob * temperature
}

/// Returns V over all choices: Σ π (Q - α ln π), all inputs `[n, choices]`. The gradient flows through π and ln π.
pub fn soft_value_of_choices(log_probs: Tensor<2>, q: Tensor<2>, temperature: f64) -> Tensor<1> {
    let values = q - log_probs.clone() * temperature;
    (log_probs.exp() * values).sum_dim(1).squeeze_dim(1)
}

/// Returns y = r + γ V', where `continues` is 1 for rows whose next state counts and 0 for the others.
pub fn q_target(rewards: Tensor<1>, continues: Tensor<1>, next_values: Tensor<1>, gamma: f64) -> Tensor<1> {
    rewards + continues * next_values * gamma
}

/// Returns mean((Q - y)²), `[1]`.
pub fn critic_loss(q: Tensor<1>, target: Tensor<1>) -> Tensor<1> {
    (q - target).square().mean()
}

/// Returns mean(-α (ln π + target entropy)), `[1]`, where `log_prob` is ln π of a draw or E\[ln π\], and constant.
pub fn temperature_loss(log_temperature: Tensor<1>, log_prob: Tensor<1>, target_entropy: f64) -> Tensor<1> {
    (log_prob + target_entropy).mean() * log_temperature.exp().neg()
}
