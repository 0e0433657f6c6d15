"""What learns a classifier for so many CPU seconds of one thread, and is looked at on the way: marsyard, scikit-learn, PyTorch, LightGBM.

In: a task (time_to_error.py): rows to learn, `look` and `error` to look by; a budget in CPU seconds of learning; a seed; a setting of rate, batch,
activation and schedule. Out: looks, each of CPU seconds so far, error on validation and on test; looking, reading and binning are not counted.
SOAP is written from Vyas et al. 2024 and SSBroyden from Urbán, Stefanou & Pons 2025: no library has them. Not here: which settings are tried
(timed_engines.py), on which rows (time_to_error.py), and the page (timed_report.py).

Needs numpy, scipy, scikit-learn, torch and lightgbm.
"""

import copy
import time

import lightgbm
import numpy as np
import scipy.optimize
import scipy.special
import torch
from sklearn.neural_network import MLPClassifier

from train_rows import looks

torch.set_num_threads(1)
TARGETS = np.array([0.1, 0.9])
HIDDEN = (16, 16)
#: CPU seconds of learning to the first look, and from one to the next: the first seconds decide most.
FIRST_LOOK_S, LOOK_FACTOR = 0.1, 1.2
#: Up to when marsyard is looked at so often, in rows; one look of the default's networks comes some tenth of a second after another, as its peers' do.
FINE_S, FINE_ROWS = 5.0, 25_000
#: The schedule of a setting that knows its budget, and is learnt anew for each.
ONE_CYCLE = "one cycle"


class Clock:
    """CPU seconds of learning, and the looks on the way."""

    def __init__(self, task, budget_s, outputs_of):
        self.task, self.budget_s, self.outputs_of, self.looks = task, budget_s, outputs_of, []
        self.learnt_s, self.next_s, self.since = 0.0, FIRST_LOOK_S, time.process_time()

    def goes_on(self):
        self.learnt_s += time.process_time() - self.since
        is_over = self.learnt_s >= self.budget_s
        if self.learnt_s >= self.next_s and not is_over:
            self.looks.append(self.task.look(self.learnt_s, self.outputs_of))
            self.next_s = max(self.learnt_s, self.next_s) * LOOK_FACTOR
        self.since = time.process_time()
        return not is_over


def best(looks, budget_s):
    """The look within a budget that is best on validation."""
    within = [look for look in looks if look[0] <= budget_s]
    return min(within, key=lambda look: look[1]) if within else None


def thinned(looks, budget_s):
    """As many looks as the others have: one at each fifth more of the time."""
    kept, next_s = [], FIRST_LOOK_S
    for look in looks:
        if next_s <= look[0] <= budget_s:
            kept.append(look)
            next_s = look[0] * LOOK_FACTOR
    return kept


def usual(task):
    return HIDDEN


def marsyard(look_rows, hidden=None, **sets):
    """A setting is an activation; `hidden`: neurons by the task, where they are not the filter's own; `look_rows`: from look to look after the first seconds."""

    def learn(task, budget_s, seed, activation):
        own = {"network.hidden": str(list(hidden(task)))} if hidden else {}
        own |= {"network.activation": activation} if activation else {}
        found = marsyard_looks(task, min(budget_s, FINE_S), seed, FINE_ROWS, sets | own)
        if budget_s > FINE_S:
            found += [look for look in marsyard_looks(task, budget_s, seed, look_rows, sets | own) if look[0] > FINE_S]
        return thinned(found, budget_s)

    return learn


def marsyard_looks(task, budget_s, seed, look_rows, sets):
    # Patience and epochs that no budget reaches.
    settings = {"seed": seed, "patience": 100_000, "epochs": 10_000, "validate_every": look_rows} | sets
    # The same training twice, by which rows it is looked at: looks after the same rows change nothing that is learnt. The second learns a little longer, to
    # have the looks that the first had. A search has no test rows.
    learn, *looked = task.rows.stored
    told = {split: looks((learn, task.labels), (of_split, task.looked[split][1]), settings, budget_s * more, task.names)
             for (split, more), of_split in zip((("validation", 1.0), ("test", 1.6)), looked) if split in task.looked}
    found = {split: of["looks"] for split, of in told.items()}
    assert all(len(of) >= len(found["validation"]) for of in found.values()), "the second training was so much slower that looks are missing: run it again"
    first = [look["cpu_learning_s"] for look in found["validation"]]
    # Of the logarithmic loss the targets are 0 and 1, and an output p stands for 0.1 + 0.8 p.
    scale = float(np.ptp(TARGETS) / np.ptp(told["validation"]["config"]["targets"])) ** 2
    return [[cpu_s, *(scale * error for error in errors)] for cpu_s, *errors in zip(first, *([look["validation_error"] for look in of] for of in found.values()))]


def mlp_classifier(batch, hidden=usual):
    def learn(task, budget_s, seed, setting):
        rate, activation = setting
        network = MLPClassifier(hidden(task), activation=activation, solver="adam", batch_size=batch, learning_rate_init=rate, random_state=seed)
        rng = np.random.default_rng(seed)
        clock = Clock(task, budget_s, lambda x: 0.1 + 0.8 * network.predict_proba(x)[:, 1])
        while True:
            order = rng.permutation(len(task.x))
            for part in np.split(order, range(5000, len(order), 5000)):
                network.partial_fit(task.x[part], task.labels[part], classes=[0, 1], sample_weight=task.weights[part])
                if not clock.goes_on():
                    return clock.looks

    return learn


class Soap(torch.optim.Optimizer):
    """Adam in the eigenbasis of Shampoo's covariances, renewed every 10 steps by a power step and QR (Vyas et al. 2024); of vectors plain Adam."""

    def __init__(self, parameters, lr):
        super().__init__(parameters, {"lr": lr})

    @torch.no_grad()
    def step(self):
        for group in self.param_groups:
            for p in group["params"]:
                state, gradient = self.state[p], p.grad
                if not state:
                    state.update(step=0, m=torch.zeros_like(p), v=torch.zeros_like(p), sides=[torch.zeros(n, n) for n in p.shape] if p.dim() == 2 else [])
                state["step"] += 1
                turn = lambda g, back=False: g
                if state["sides"]:
                    left, right = state["sides"]
                    left.lerp_(gradient @ gradient.T, 0.05)
                    right.lerp_(gradient.T @ gradient, 0.05)
                    if "bases" not in state:
                        state["bases"] = [torch.linalg.eigh(side + 1e-12 * torch.eye(len(side)))[1] for side in (left, right)]
                    elif state["step"] % 10 == 0:
                        state["bases"] = [torch.linalg.qr(side @ basis)[0] for side, basis in zip((left, right), state["bases"])]
                    a, b = state["bases"]
                    turn = lambda g, back=False: a @ g @ b.T if back else a.T @ g @ b
                state["m"].lerp_(gradient, 0.05)
                turned = turn(gradient)
                state["v"].lerp_(turned * turned, 0.05)
                m, v = turn(state["m"]) / (1 - 0.95 ** state["step"]), state["v"] / (1 - 0.95 ** state["step"])
                p.sub_(turn(m / (v.sqrt() + 1e-8), back=True), alpha=group["lr"])


def muon_of(network, rate):
    """Muon on the matrices, Adam on biases and the last layer, as its authors use it."""
    matrices = [p for p in list(network.parameters())[:-2] if p.dim() == 2]
    others = [p for p in network.parameters() if not any(p is m for m in matrices)]
    return [torch.optim.Muon(matrices, lr=rate, weight_decay=0.0), torch.optim.Adam(others, lr=0.3 * rate)]


OPTIMISERS = {
    "Adam": lambda network, rate: [torch.optim.Adam(network.parameters(), lr=rate, fused=True)],
    "SOAP": lambda network, rate: [Soap(network.parameters(), rate)],
    "Muon": muon_of,
}


def perceptron(inputs, hidden, activation):
    sizes = [inputs, *hidden, 1]
    layers = [part for a, b in zip(sizes[:-1], sizes[1:]) for part in (torch.nn.Linear(a, b), activation())]
    return torch.nn.Sequential(*layers[:-1], torch.nn.Sigmoid())


class Members(torch.nn.Module):
    """Networks side by side, an output each."""

    def __init__(self, *networks):
        super().__init__()
        self.networks = torch.nn.ModuleList(networks)

    def forward(self, x):
        return torch.cat([network(x) for network in self.networks], dim=1)


def torch_members(task, seed, activation):
    """Of the default's size and form; with what averages their weights after a step. What is looked at is the average."""
    torch.manual_seed(seed)
    network = Members(*(perceptron(task.x.shape[1], (64, 64), activation) for _ in range(2)))
    looked_at, steps = copy.deepcopy(network), [0]

    @torch.no_grad()
    def average():
        steps[0] += 1
        torch._foreach_lerp_(list(looked_at.parameters()), list(network.parameters()), min(1.0, 9 / steps[0]))

    def outputs(x):
        with torch.no_grad():
            return looked_at(torch.from_numpy(x)).mean(dim=1).numpy().astype(float)

    return network, outputs, average


def torch_network(task, seed, activation, hidden=HIDDEN):
    torch.manual_seed(seed)
    network = perceptron(task.x.shape[1], hidden, activation)

    def outputs(x):
        with torch.no_grad():
            return network(torch.from_numpy(x).to(network[0].weight.dtype)).numpy()[:, 0].astype(float)

    return network, outputs


def tensors(task, rows=None):
    return (torch.from_numpy(task.x[:rows]), torch.from_numpy(TARGETS[task.labels[:rows]].astype(np.float32))[:, None],
            torch.from_numpy(task.weights[:rows].astype(np.float32))[:, None])


def minibatches(optimiser, members=False, hidden=usual):
    def learn(task, budget_s, seed, setting):
        rate, batch, activation, *schedule = setting
        network, outputs, average = torch_members(task, seed, activation) if members else (*torch_network(task, seed, activation, hidden(task)), lambda: None)
        optimisers = OPTIMISERS[optimiser](network, rate)
        x, target, weight = tensors(task)
        clock = Clock(task, budget_s, outputs)
        while True:
            for part in torch.randperm(len(x)).split(batch):
                if schedule == [ONE_CYCLE]:
                    # By the share of the budget that is over: a third of the way up, then down to nothing, on a cosine.
                    share = min(1.0, (clock.learnt_s + time.process_time() - clock.since) / budget_s)
                    up, down = min(1.0, share / 0.3), max(0.0, (share - 0.3) / 0.7)
                    for group in optimisers[0].param_groups:
                        group["lr"] = rate * (0.04 + 0.96 * 0.5 * (1 - np.cos(np.pi * up)) if share < 0.3 else 1e-4 + 0.5 * (1 + np.cos(np.pi * down)))
                loss = (weight[part] * (network(x[part]) - target[part]).square()).mean(dim=0).sum()
                for one in optimisers:
                    one.zero_grad()
                loss.backward()
                for one in optimisers:
                    one.step()
                average()
                if not clock.goes_on():
                    return [*clock.looks, task.look(budget_s, outputs)]

    return learn


def lbfgs(task, budget_s, seed, setting):
    rows, activation = setting
    network, outputs = torch_network(task, seed, activation)
    x, target, weight = tensors(task, rows)
    optimiser = torch.optim.LBFGS(network.parameters(), max_iter=5, history_size=20, line_search_fn="strong_wolfe")

    def closure():
        optimiser.zero_grad()
        loss = (weight * (network(x) - target).square()).mean()
        loss.backward()
        return loss

    clock = Clock(task, budget_s, outputs)
    while True:
        optimiser.step(closure)
        if not clock.goes_on():
            return clock.looks


def ssbroyden(task, budget_s, seed, setting):
    rows, activation = setting
    network, outputs = torch_network(task, seed, activation)
    network.double()
    x, target, weight = (part.double() for part in tensors(task, rows))
    place = lambda at: torch.nn.utils.vector_to_parameters(torch.from_numpy(at), network.parameters())
    seen = {}

    def loss(at):
        # Value and slope come together; the line search asks for one and then for the other.
        if "at" not in seen or not np.array_equal(seen["at"], at):
            place(at)
            network.zero_grad()
            value = (weight * (network(x) - target).square()).mean()
            value.backward()
            slope = torch.cat([one.grad.flatten() for one in network.parameters()]).numpy().copy()
            seen.update(at=at.copy(), value=value.item(), slope=slope)
        return seen["value"]

    def slope(at):
        loss(at)
        return seen["slope"]

    at = torch.nn.utils.parameters_to_vector(network.parameters()).detach().numpy().copy()
    inverse, before = np.eye(len(at)), None
    clock = Clock(task, budget_s, outputs)
    while True:
        g, value = slope(at), loss(at)
        step = -inverse @ g
        length, *_ = scipy.optimize.line_search(loss, slope, at, step, g, value, before)
        if length is None:
            # Rounding, or a direction that is none any more: it begins anew.
            if before is None:
                return clock.looks
            inverse, before = np.eye(len(at)), None
            continue
        before, moved = value, length * step
        at = at + moved
        changed = slope(at) - g
        if moved @ changed > 0.0:
            inverse = self_scaled_broyden(inverse, moved, changed, -length * (moved @ g))
        place(at)
        if not clock.goes_on():
            return clock.looks


def self_scaled_broyden(inverse, s, y, sbs):
    """The inverse of the Hessian after a step s that changed the slope by y; sbs: s' B s of before."""
    hy, ys = inverse @ y, y @ s
    yhy = y @ hy
    b, h = sbs / ys, yhy / ys
    a = max(b * h - 1.0, 1e-12)
    below = min(1.0, h * (1.0 - np.sqrt(a / (1.0 + a))))
    theta = max((below - 1.0) / a, min(1.0 / below, (1.0 - b) / b))
    sigma = 1.0 + a * theta
    scaled = min(1.0, 1.0 / b)
    tau = scaled * min(sigma ** (1.0 / (1 - len(s))), 1.0 / theta) if theta > 0 else min(scaled * sigma ** (1.0 / (1 - len(s))), sigma)
    v = s / ys - hy / yhy
    return (inverse - np.outer(hy, hy) / yhy + (1.0 - theta) / sigma * yhy * np.outer(v, v)) / tau + np.outer(s, s) / ys


def trees(settings, ends_early):
    """Looks of a training for each of the settings, with the whole budget each: which is best depends on how long it has."""

    def learn(task, budget_s, seed, _):
        looks, data = [], {}
        for rows, parameters in settings:
            if 2 * (rows or 0) <= len(task.labels):
                if rows not in data:
                    # Binning is preparation, as standardising is.
                    binning = {"verbose": -1, "num_threads": 1, "feature_pre_filter": False}
                    data[rows] = lightgbm.Dataset(task.x[:rows], task.labels[:rows], weight=task.weights[:rows], params=binning).construct()
                looks += trees_at(task, data[rows], budget_s, seed, parameters, looks if ends_early else None)
        return looks

    return learn


def trees_at(task, data, budget_s, seed, parameters, others):
    """`others`: looks of earlier trainings, where a training may end early: long past its best, or far behind."""
    looks, scores = [], {split: np.zeros(len(labels)) for split, (_, labels) in task.looked.items()}
    shown, learnt_s, since = 0, 0.0, time.process_time()

    def over(count):
        raise lightgbm.callback.EarlyStopException(count - 1, [])

    def callback(env):
        nonlocal shown, learnt_s, since
        learnt_s += time.process_time() - since
        count = env.iteration + 1
        if learnt_s > budget_s:
            over(count)
        if count >= shown * 1.15:
            for split, (x, _) in task.looked.items():
                scores[split] += env.model.predict(x, start_iteration=shown, num_iteration=count - shown, raw_score=True, num_threads=1)
            shown = count
            looks.append([round(learnt_s, 4), *(task.error(split, 0.1 + 0.8 * scipy.special.expit(scores[split])) for split in task.looked)])
            if others is not None and learnt_s > 10.0:
                is_past = learnt_s > 3 * best(looks, budget_s)[0]
                if is_past or looks[-1][1] > 2 * min((look[1] for look in others if look[0] <= learnt_s), default=np.inf):
                    over(count)
        since = time.process_time()

    shared = {"objective": "binary", "num_threads": 1, "seed": seed, "verbose": -1, "force_col_wise": True, "feature_pre_filter": False}
    lightgbm.train(shared | parameters, data, num_boost_round=100_000, callbacks=[callback])
    return looks
