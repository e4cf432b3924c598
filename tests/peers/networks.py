"""The networks of this project, written for PyTorch."""

import torch
from torch import nn
from torch.nn import functional as F


class Block(nn.Module):
    """x + conv1(relu(conv0(relu(x))))."""

    def __init__(self, channels):
        super().__init__()
        self.conv0 = nn.Conv2d(channels, channels, 3, padding=1)
        self.conv1 = nn.Conv2d(channels, channels, 3, padding=1)

    def forward(self, x):
        return x + self.conv1(F.relu(self.conv0(F.relu(x))))


class Stage(nn.Module):
    """A convolution, max-pooling, and two residual blocks."""

    def __init__(self, inputs, outputs):
        super().__init__()
        self.conv = nn.Conv2d(inputs, outputs, 3, padding=1)
        self.blocks = nn.Sequential(Block(outputs), Block(outputs))

    def forward(self, x):
        return self.blocks(F.max_pool2d(self.conv(x), 3, 2, 1))


def impala(features=256):
    return nn.Sequential(
        Stage(3, 16), Stage(16, 32), Stage(32, 32), nn.ReLU(), nn.Flatten(), nn.Linear(32 * 8 * 8, features), nn.ReLU()
    )


def nature(features=512):
    return nn.Sequential(
        nn.Conv2d(3, 32, 8, 4), nn.ReLU(), nn.Conv2d(32, 64, 4, 2), nn.ReLU(), nn.Conv2d(64, 64, 3, 1), nn.ReLU(),
        nn.Flatten(), nn.Linear(64 * 4 * 4, features), nn.ReLU(),
    )


def mlp(inputs, hidden, outputs, activation=nn.Tanh):
    """Layers with an activation after each but the last."""
    sizes = [inputs, *hidden]
    layers = [layer for pair in zip(sizes, hidden) for layer in (nn.Linear(*pair), activation())]
    return nn.Sequential(*layers, nn.Linear(sizes[-1], outputs))


class Skills(nn.Module):
    """The paper's skill model over vectors: encoder, decoder and prior; `loss` is that of a batch of windows."""

    def __init__(self, obs, actions, latent=8, width=200, layers=4):
        super().__init__()
        self.state = mlp(obs, [width, width], width, nn.ReLU)
        self.gru = nn.GRU(width + actions, width, layers, bidirectional=True)
        self.mean, self.log_std = nn.Linear(2 * width, latent), nn.Linear(2 * width, latent)
        self.decoder, self.decoder_std = mlp(obs + latent, [200, 200], actions, nn.ReLU), nn.Parameter(torch.zeros(actions))
        self.prior, self.prior_std = mlp(obs, [200, 200], latent, nn.ReLU), nn.Parameter(torch.zeros(latent))

    def loss(self, states, actions, beta=0.1):
        steps, batch, _ = states.shape
        out, _ = self.gru(torch.cat([self.state(states), actions], 2))
        width = out.shape[2] // 2
        summary = torch.cat([out[-1, :, :width], out[0, :, width:]], 1)
        posterior = torch.distributions.Normal(self.mean(summary), self.log_std(summary).exp())
        prior = torch.distributions.Normal(self.prior(states[0]), self.prior_std.exp())
        z = posterior.rsample()
        joined = torch.cat([states, z.expand(steps, batch, -1)], 2)
        decoded = torch.distributions.Normal(self.decoder(joined), self.decoder_std.exp())
        nll = -decoded.log_prob(actions).sum() / batch
        return nll + beta * torch.distributions.kl_divergence(posterior, prior).sum(1).mean()
