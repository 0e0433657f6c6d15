"""Networks in PyTorch for compare_classifiers.py: marsyard's own shapes learnt by Adam, and TabM (Gorishniy et al. 2025) from scratch.

All learn the class-weighted log loss in batches, look at the validation rows after each pass and keep the best pass.
"""

import io

import numpy as np
import torch
from torch import nn

from timed_learners import perceptron

torch.set_num_threads(1)


def mlp(inputs, hidden, activation):
    """One output, the logit of the probability."""
    return perceptron(inputs, hidden, activation)[:-1]


class Adapted(nn.Module):
    """A linear layer that all members share, between each member's own factors of its inputs and outputs and its own bias."""

    def __init__(self, members, inputs, outputs, signs):
        super().__init__()
        self.shared = nn.Linear(inputs, outputs, bias=False)
        # Members begin apart by random signs in front of the first layer alone, and alike everywhere else.
        self.before = nn.Parameter(torch.randint(0, 2, (members, inputs)) * 2.0 - 1.0 if signs else torch.ones(members, inputs))
        self.after = nn.Parameter(torch.ones(members, outputs))
        self.bias = nn.Parameter((torch.rand(members, outputs) * 2 - 1) / inputs**0.5)

    def forward(self, x):
        return self.shared(x * self.before) * self.after + self.bias


class TabM(nn.Module):
    """k networks of two hidden layers that share all but their adapters and last layers; their losses and probabilities are averaged."""

    def __init__(self, inputs, width=32, members=16):
        super().__init__()
        self.first, self.second = Adapted(members, inputs, width, True), Adapted(members, width, width, False)
        self.last = nn.Parameter((torch.rand(members, width) * 2 - 1) / width**0.5)
        self.bias = nn.Parameter(torch.zeros(members))

    def forward(self, x):
        x = torch.relu(self.second(torch.relu(self.first(x[:, None, :]))))
        return (x * self.last).sum(dim=2) + self.bias


def probability(network, x):
    """Averaged over the members."""
    with torch.no_grad():
        parts = [torch.sigmoid(network(part)).mean(dim=1) for part in torch.from_numpy(x).split(8192)]
    return torch.cat(parts).numpy().astype(float)


def learn(make, rows, seed, many, rate, one_cycle):
    """The best pass of a network that is made anew. One cycle: Adam at a rate that rises and falls over all passes; else AdamW at a constant one."""
    torch.manual_seed(seed)
    network = make()
    batch = 1024 if many else 256
    # One cycle: the best of five pairs of passes and rate on validation rows of configs/paper.yaml.
    passes, patience = (12, 12) if one_cycle else ((4, 2) if many else (20, 4))
    x, target = torch.from_numpy(rows.x), torch.from_numpy(rows.y.astype(np.float32))
    weight = torch.from_numpy(rows.weights.astype(np.float32))
    steps = passes * -(-len(x) // batch)
    if one_cycle:
        optimiser = torch.optim.Adam(network.parameters(), lr=rate, fused=True)
        schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, rate, total_steps=steps)
    else:
        optimiser = torch.optim.AdamW(network.parameters(), lr=rate, weight_decay=3e-4, fused=True)
        schedule = torch.optim.lr_scheduler.ConstantLR(optimiser, 1.0, 1)
    loss = nn.functional.binary_cross_entropy_with_logits
    best = (np.inf, 0, None)
    for done in range(1, passes + 1):
        for part in torch.randperm(len(x)).split(batch):
            optimiser.zero_grad()
            outputs = network(x[part])
            wanted = target[part][:, None].expand_as(outputs)
            loss(outputs, wanted, weight[part][:, None].expand_as(outputs)).backward()
            optimiser.step()
            schedule.step()
        error = validation_loss(network, rows)
        if error < best[0]:
            best = (error, done, {name: value.clone() for name, value in network.state_dict().items()})
        elif done - best[1] >= patience:
            break
    network.load_state_dict(best[2])
    network.best_pass = best[1]
    return network


def validation_loss(network, rows):
    """Weighted log loss of the averaged probabilities."""
    said = np.clip(probability(network, rows.choose_x), 1e-6, 1 - 1e-6)
    losses = -np.where(rows.choose_y == 1, np.log(said), np.log1p(-said))
    return float(np.average(losses, weights=rows.choose_weights))


def size(network):
    file = io.BytesIO()
    torch.save(network.state_dict(), file)
    return sum(p.numel() for p in network.parameters()), file.getbuffer().nbytes
