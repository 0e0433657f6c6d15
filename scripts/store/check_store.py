#!/usr/bin/env python3
"""A corpus in an object store, against the same corpus in a folder: a real S3-compatible server (moto) on loopback, and a proxy
before it that drops, delays and breaks requests.

    python scripts/store/check_store.py MARSYARD [--faulty-builds 1] [--kills 3] [--seed 1] [--results FILE]

Checked: every file in the bucket is the folder's, byte for byte; status, finalize, verify, inspect, explain, train, evaluate,
search and classify work from URLs and give what they give from folders; builds that are killed and resumed, two builds at once,
and builds, reads and trainings through faults end in the same bytes; faults that never end lead to exit 75 in bounded time,
wrong credentials, missing buckets, redirects and floods to exit 2 in seconds, flipped bits and strange certificates to exit 1;
damage is found and repaired; and no key or token is in any output or file. Exit 1 at the first difference.
"""

import argparse
import http.server
import importlib.metadata
import json
import os
import pathlib
import random
import re
import signal
import socket
import ssl
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request

import boto3
import numpy as np
from faulty import FaultyProxy

HERE = pathlib.Path(__file__).resolve().parent
CONFIG = HERE.parent.parent / "tests" / "fixtures" / "training.yaml"
BUCKET = "yards"
KEY, SECRET, TOKEN = "AKIDEXAMPLE4711KEY", "hush/4711+thisMustNeverBeSeen", "hushTokenThatMustNeverBeSeen"
AZURE_KEY = "aHVzaEF6dXJlS2V5VGhhdE11c3ROZXZlckJlU2Vlbg=="
#: The corpus holds fewer rows than the default network has weights.
SMALL = ("--set", "network.hidden=[16,16]", "--set", "epochs=2")
NOT_COMPARED = {"report.json"}


def expect(good, what):
    if not good:
        print(f"FAILED {what}", file=sys.stderr, flush=True)
        sys.exit(1)


def say(what, begun):
    print(f"{time.monotonic() - begun:6.1f} s  {what}", flush=True)


class Bench:
    """The binary, its environment, and everything that it ever said."""

    def __init__(self, binary, scratch):
        self.binary, self.scratch, self.said = str(pathlib.Path(binary).resolve()), pathlib.Path(scratch), []
        kept = {name: value for name, value in os.environ.items() if not name.startswith(("AWS_", "GOOGLE_", "AZURE_"))}
        self.env = kept | {"HOME": str(scratch), "NO_PROXY": "127.0.0.1", "no_proxy": "127.0.0.1", "AWS_REGION": "us-east-1",
                           "AWS_EC2_METADATA_DISABLED": "true", "NO_GCE_CHECK": "true"}
        self.env |= {"AWS_ACCESS_KEY_ID": KEY, "AWS_SECRET_ACCESS_KEY": SECRET, "AWS_SESSION_TOKEN": TOKEN}

    def start(self, *words, env=None):
        whole = {name: value for name, value in (self.env | (env or {})).items() if value is not None}
        words = [self.binary, *map(str, words)]
        return subprocess.Popen(words, env=whole, cwd=self.scratch, stdout=subprocess.PIPE, stderr=subprocess.PIPE)

    def end(self, process, timeout=300):
        out, err = (stream.decode() for stream in process.communicate(timeout=timeout))
        self.said.append(out + err)
        return process.returncode, out, err

    def failure(self, code, *words, env=None, timeout=300):
        """What a verb says that ends with a code, in one line."""
        _, err = self.run("--log", "json", *words, code=code, env=env, timeout=timeout)
        lines = [json.loads(line) if line.startswith("{") else {"message": line} for line in err.splitlines()]
        return " ".join(" ".join(f"{line.get('message', '')} {line.get('help', '')}" for line in lines).split())

    def run(self, *words, code=0, env=None, timeout=300):
        got, out, err = self.end(self.start(*words, env=env), timeout)
        expect(got == code, f"`marsyard {' '.join(map(str, words))}` ended with {got}, not {code}:\n{out}{err}")
        return out, err


def start_moto(port):
    server = subprocess.Popen([sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(port)],
                              stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    for _ in range(600):
        try:
            opener.open(f"http://127.0.0.1:{port}/moto-api/data.json", timeout=5).read()
            return server
        except OSError:
            expect(server.poll() is None, "moto_server does not start")
            time.sleep(0.1)
    sys.exit("FAILED moto_server does not answer within a minute")


def free_port():
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


def in_folder(folder):
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


class Bucket:
    def __init__(self, port):
        self.client = boto3.client("s3", endpoint_url=f"http://127.0.0.1:{port}", region_name="us-east-1",
                                   aws_access_key_id=KEY, aws_secret_access_key=SECRET,
                                   config=boto3.session.Config(proxies={}, s3={"addressing_style": "path"}))
        self.client.create_bucket(Bucket=BUCKET)

    def files(self, prefix):
        pages = self.client.get_paginator("list_objects_v2").paginate(Bucket=BUCKET, Prefix=prefix + "/")
        names = [entry["Key"] for page in pages for entry in page.get("Contents", [])]
        return {name[len(prefix) + 1 :]: self.get(name) for name in names}

    def get(self, name):
        return self.client.get_object(Bucket=BUCKET, Key=name)["Body"].read()

    def put(self, name, data):
        self.client.put_object(Bucket=BUCKET, Key=name, Body=data)

    def delete(self, name):
        self.client.delete_object(Bucket=BUCKET, Key=name)


def same_files(there, here, what):
    expect(there.keys() == here.keys(), f"{what}: other files: {sorted(there.keys() ^ here.keys())}")
    for name in there.keys() - NOT_COMPARED:
        expect(there[name] == here[name], f"{what}: {name} differs from the folder's")


def check_verbs(bench, bucket, local, url, endpoint):
    """Every verb that reads a corpus, from the URL and from the folder."""
    out, _ = bench.run("status", url, env=endpoint)
    expect("done           7" in out and "missing        0" in out, f"status says\n{out}")
    expect(bench.run("status", url, "--missing", env=endpoint)[0] == "", "status --missing is not empty")
    plan = json.loads(bench.run("plan", CONFIG, "--no-parts", "--json", "--out", f"s3://{BUCKET}/planned", env=endpoint)[0])
    expect(plan["estimate"]["storage"]["bytes_per_s"] > 0, "plan does not measure the store")
    expect(not bucket.files("planned"), "plan leaves something in the store")
    bench.run("finalize", url, env=endpoint)
    # What a rebuild found is written beside the corpus, the same in both places; the comparisons that follow go on without it.
    bench.run("verify", url, "--rebuild", "all", env=endpoint)
    bench.run("verify", local, "--rebuild", "all")
    found = bench.scratch / local / "rebuilt.json"
    there, here = bucket.get("corpus/rebuilt.json").decode(), found.read_text()
    expect(there == here, f"a rebuild records other things of the URL: {there} and of the folder: {here}")
    bucket.delete("corpus/rebuilt.json")
    found.unlink()
    expect(bench.run("inspect", url, env=endpoint)[0] == bench.run("inspect", local)[0], "inspect says other things of the URL")
    said = bench.run("explain", local, "--scene", "3")[0]
    expect(bench.run("explain", url, "--scene", "3", env=endpoint)[0] == said, "explain differs")
    cell = said.rsplit("--cell ", 1)[1].strip()
    out, _ = bench.run("explain", url, "--scene", "3", f"--cell={cell}", env=endpoint)
    expect("the stored row is the same, bit for bit" in out, "explain does not compare with the stored row")
    bench.run("preview", url, "--scene", "3", "--out", "seen", env=endpoint)

    quick = [*SMALL, "--threads", "2"]
    bench.run("train", local, *quick, "--out", "run-local")
    bench.run("train", f"{url}:2", *quick, "--out", "run-weighted", env=endpoint)
    bench.run("train", url, *quick, "--out", "run-url", env=endpoint)
    there, here = (in_folder(bench.scratch / name) for name in ("run-url", "run-local"))
    for name in ("model.safetensors", "filter.safetensors", "training.json", "curves.svg", "evaluation.json"):
        expect(there[name] == here[name], f"train from the URL gives another {name}")
    for name, data in here.items():
        bucket.put(f"runs/a/{name}", data)
    run = f"s3://{BUCKET}/runs/a"
    judged = bench.run("evaluate", run, url, "--json", "--out", f"s3://{BUCKET}/judged", env=endpoint)[0]
    expect(judged == bench.run("evaluate", "run-local", local, "--json")[0], "evaluate differs")
    expect(bucket.get("judged/evaluation.json").decode() == judged, "evaluate --out URL wrote something else")
    bench.run("train", url, *quick, "--init", run, "--out", "run-init", env=endpoint)
    rows = ["--widths", "2,3", "--layers", "1", "--epochs", "1", "--rungs", "1", "--rows", "600", "--validation-rows", "300"]
    bench.run("search", url, *rows, "--out", "found-url", env=endpoint)
    bench.run("search", local, *rows, "--out", "found-local")
    expect((bench.scratch / "found-url/train.yaml").read_bytes() == (bench.scratch / "found-local/train.yaml").read_bytes(),
           "search chooses otherwise")

    spots = np.random.default_rng(5).uniform(-3, 3, (3000, 3)) * [1, 1, 0.02] - [0, 0, 0.5]
    cloud = "x,y,z,intensity\n" + "".join(f"{x:.4f},{y:.4f},{z:.4f},0.5\n" for x, y, z in spots)
    (bench.scratch / "scan.csv").write_text(cloud)
    bucket.put("clouds/scan.csv", cloud.encode())
    pose = ["--sensor-height", "0.5"]
    bench.run("classify", "run-local", "scan.csv", *pose, "--out", "judged-local")
    there = [f"{run}/model.safetensors", f"s3://{BUCKET}/clouds/scan.csv"]
    bench.run("classify", *there, *pose, "--out", "judged-url", env=endpoint)
    there, here = in_folder(bench.scratch / "judged-url"), in_folder(bench.scratch / "judged-local")
    expect(there["cells.parquet"] == here["cells.parquet"], "classify gives other cells")
    expect(there["scan-mesh.ply"] != b"" and there.keys() == here.keys(), "classify gives other files")


def check_refusals(bench, url, endpoint, proxy):
    """What trying again does not help: exit 2, in seconds, with a cure."""
    def refused(words, needle, env=None):
        begun = time.monotonic()
        said = bench.failure(2, *words, env=endpoint | (env or {}))
        expect(needle in said, f"{words}: no '{needle}' in\n{said}")
        expect(time.monotonic() - begun < 20, f"{words} took {time.monotonic() - begun:.0f} s to be refused")

    gone = "s3://no-such-bucket/x"
    refused(["generate", CONFIG, "--out", gone], "no such bucket")
    refused(["status", f"s3://{BUCKET}/nothing"], "holds no plan.yaml")
    no_keys = {name: None for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY", "AWS_SESSION_TOKEN")}
    refused(["status", url], "no credentials", no_keys)
    refused(["status", url], "AWS_PROFILE is 'nobody'", no_keys | {"AWS_PROFILE": "nobody"})
    refused(["status", url], "AWS_ALLOW_HTTP=true", {"AWS_ENDPOINT_URL": "http://store.invalid:9000"})
    refused(["train", "https://127.0.0.1/x"], "AWS_ENDPOINT_URL")
    refused(["train", url, "--out", f"s3://{BUCKET}/run"], "cannot be a URL")
    for leak in (f"s3://{KEY}:{SECRET}@{BUCKET}/x", f"az://box/x?sig={SECRET}"):
        refused(["verify", leak], "is a URL with a user name")
    refused(["status", "gs://bucket/x"], "GOOGLE_APPLICATION_CREDENTIALS")
    refused(["status", "az://box/x"], "AZURE_STORAGE_ACCOUNT_NAME")
    proxy.faults = {"denied": 1}
    through = f"http://127.0.0.1:{proxy.port}"
    refused(["status", url], "403", {"AWS_ENDPOINT_URL": through})
    refused(["generate", CONFIG, "--out", url], "look at the credentials", {"AWS_ENDPOINT_URL": through})
    azure = {"AZURE_STORAGE_ACCOUNT_NAME": "yards", "AZURE_STORAGE_ACCOUNT_KEY": AZURE_KEY}
    refused(["status", "az://box/x"], "403", azure | {"AZURE_STORAGE_ENDPOINT": through})
    refused(["status", "gs://box/x"], "403", {"GOOGLE_BASE_URL": through, "GOOGLE_BEARER_TOKEN": TOKEN})
    proxy.faults = {}


def check_profile(bench, url, port):
    """The standard files in place of the environment."""
    (bench.scratch / "keys").write_text(f"[lab]\naws_access_key_id = {KEY}\naws_secret_access_key = {SECRET}\n")
    (bench.scratch / "settings").write_text(f"[profile lab]\nregion = us-east-1\nendpoint_url = http://127.0.0.1:{port}\n")
    env = {name: None for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY", "AWS_SESSION_TOKEN", "AWS_REGION")}
    env |= {"AWS_PROFILE": "lab", "AWS_SHARED_CREDENTIALS_FILE": "keys", "AWS_CONFIG_FILE": "settings"}
    bench.run("status", url, env=env)
    (bench.scratch / "keys").unlink()


def check_endless(bench, url, proxy):
    """Faults that do not end: exit 75 in bounded time; what is stored stays."""
    env = {"AWS_ENDPOINT_URL": f"http://127.0.0.1:{proxy.port}", "MARSYARD_RETRY_S": "2"}
    train, build = ["train", url, "--out", "run-endless"], ["generate", CONFIG, "--out", f"{url}-endless"]
    each = {"busy": train, "broken": build, "deaf": ["status", url], "short": train, "cut": ["verify", url], "dropped": build,
            "hang": ["inspect", url]}
    for fault, verb in each.items():
        proxy.faults = {fault: 1}
        begun, before = time.monotonic(), proxy.requests
        said = bench.failure(75, *verb, env=env)
        expect("2 s of trying" in said, f"{fault}: the message says\n{said}")
        expect(time.monotonic() - begun < 30, f"{fault}: {verb[0]} took {time.monotonic() - begun:.0f} s to give up")
        expect(proxy.requests - before < 200, f"{fault}: {verb[0]} made {proxy.requests - before} requests")
    proxy.faults = {}
    said = bench.failure(75, "status", url, env=env | {"AWS_ENDPOINT_URL": f"http://127.0.0.1:{free_port()}"})
    expect("cannot connect" in said, f"a server that is down: {said}")


def serve_tls():
    """A server on loopback whose certificate nobody signed; its port."""
    fixture = CONFIG.parent / "loopback"
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(fixture / "certificate.pem", fixture / "key.pem")
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), http.server.BaseHTTPRequestHandler)
    server.socket = context.wrap_socket(server.socket, server_side=True)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return server.server_address[1]


def check_hostile(bench, bucket, url, proxy):
    """Servers that lie: refused at once, or given up in bounded time and memory; nothing is taken from another host."""
    env = {"AWS_ENDPOINT_URL": f"http://127.0.0.1:{proxy.port}", "MARSYARD_RETRY_S": "3"}

    def ends(code, needle, *words, within, env=env):
        begun = time.monotonic()
        said = bench.failure(code, *words, env=env)
        expect(needle in said, f"{words}: no '{needle}' in\n{said}")
        expect(time.monotonic() - begun < within, f"{words} took {time.monotonic() - begun:.0f} s")

    other = FaultyProxy(proxy.upstream, 1)
    proxy.other, proxy.faults = f"http://127.0.0.1:{other.port}", {"elsewhere": 1}
    for verb in (["status", url], ["verify", url], ["generate", CONFIG, "--out", f"{url}-elsewhere"]):
        ends(2, "redirects are not followed", *verb, within=20)
    expect(other.requests == 0, "a redirect to another host was followed")
    other.close()
    proxy.faults = {"flood": 1}
    for verb in (["status", url], ["inspect", url], ["verify", url], ["plan", f"{url}/plan.yaml"]):
        ends(2, "bytes, more than the", *verb, within=20)
    proxy.faults = {"flipped": 1}
    ends(1, "twice other bytes were stored", "generate", CONFIG, "--out", f"{url}-flipped", within=60)
    expect(not bucket.files("corpus-flipped"), "a damaged put was left there")
    proxy.faults = {}
    tls = env | {"AWS_ENDPOINT_URL": f"https://127.0.0.1:{serve_tls()}"}
    ends(1, "SSL_CERT_FILE", "status", url, within=20, env=tls)


def check_damage(bench, bucket, name, url, endpoint, whole):
    """Objects that were removed, changed or put there by others."""
    cells = "data/cells/train-0000001.parquet"
    bucket.delete(f"{name}/{cells}")
    expect(bench.run("status", url, "--missing", env=endpoint)[0].strip() in ("1", "1..2"), "a missing table is not found")
    bench.run("generate", CONFIG, "--out", url, env=endpoint)
    same_files(bucket.files(name), whole, "after a removed table")
    changed = bytearray(whole[cells])
    changed[len(changed) // 2] ^= 1
    bucket.put(f"{name}/{cells}", bytes(changed))
    out, _ = bench.run("verify", url, env=endpoint, code=1)
    expect("bytes have changed" in out, f"verify finds no damage: {out}")
    bench.run("train", url, "--out", "run-damaged", *SMALL, env=endpoint, code=1)
    bench.run("verify", url, "--repair", env=endpoint)
    same_files(bucket.files(name), whole, "after a repair")
    bucket.delete(f"{name}/receipts/0000001.json")
    bucket.put(f"{name}/{cells}", b"something else")
    said = bench.failure(1, "generate", CONFIG, "--out", url, env=endpoint)
    expect("other bytes" in said, f"a foreign object is not refused: {said}")
    said = bench.failure(2, "verify", url, "--repair", env=endpoint)
    expect("which marsyard did not write" in said, f"a repair would remove a foreign object: {said}")
    expect(bucket.get(f"{name}/{cells}") == b"something else", "a foreign object is gone")
    bucket.delete(f"{name}/{cells}")
    bench.run("generate", CONFIG, "--out", url, env=endpoint)
    same_files(bucket.files(name), whole, "after a foreign object")
    bucket.put("project/src/main.c", b"mine")
    said = bench.failure(2, "generate", CONFIG, "--out", f"s3://{BUCKET}/project", env=endpoint)
    expect("which marsyard did not write" in said, f"a place with a foreign object is not refused: {said}")
    expect(list(bucket.files("project")) == ["src/main.c"], "a refused build leaves something")
    said = bench.failure(2, "generate", CONFIG, "--out", url, "--set", "seed=8", env=endpoint)
    expect("holds another corpus" in said, f"another plan is not refused: {said}")


def check_height_map(bench, bucket, endpoint):
    """A plan with a file beside it, both in the store."""
    np.save(bench.scratch / "heights.npy", np.random.default_rng(2).normal(0, 0.02, (32, 32)))
    text = re.sub(r"  ground: .*", "  ground: { source: { file: { path: heights.npy } } }", CONFIG.read_text())
    text = text.replace("scenes: 14", "scenes: 4")
    (bench.scratch / "heights.yaml").write_text(text)
    bench.run("generate", "heights.yaml", "--out", "heights", "--shards", "0..1")
    url = f"s3://{BUCKET}/heights"
    bench.run("generate", "heights.yaml", "--out", url, "--shards", "0..1", env=endpoint)
    bench.run("generate", f"{url}/plan.yaml", "--out", url, env=endpoint)
    bench.run("generate", "heights.yaml", "--out", "heights")
    same_files(bucket.files("heights"), in_folder(bench.scratch / "heights"), "a corpus with a height map")
    expect(bench.run("explain", url, "--scene", "1", env=endpoint)[0] == bench.run("explain", "heights", "--scene", "1")[0],
           "explain with a height map differs")


def check_kills(bench, bucket, endpoint, whole, kills, seed, seconds):
    draw = random.Random(seed)
    url = f"s3://{BUCKET}/killed"
    for _ in range(kills):
        process = bench.start("generate", CONFIG, "--out", url, "--threads", "2", env=endpoint)
        time.sleep(draw.uniform(0.1, 0.8) * seconds)
        process.send_signal(draw.choice([signal.SIGKILL, signal.SIGTERM]))
        code, _, err = bench.end(process)
        expect(code in (0, 75, -signal.SIGKILL, -signal.SIGTERM), f"a killed build ended with {code}: {err}")
    bench.run("generate", CONFIG, "--out", url, env=endpoint)
    same_files(bucket.files("killed"), whole, "killed and resumed")


def check_two(bench, bucket, endpoint, whole):
    url = f"s3://{BUCKET}/two"
    builds = [bench.start("generate", CONFIG, "--out", url, "--threads", str(n), env=endpoint) for n in (1, 2)]
    for build in builds:
        code, _, err = bench.end(build)
        expect(code == 0, f"one of two builds at once ended with {code}: {err}")
    same_files(bucket.files("two"), whole, "two builds at once")


def check_faulty(bench, bucket, proxy, whole, number, model):
    name = f"faulty-{number}"
    url, env = f"s3://{BUCKET}/{name}", {"AWS_ENDPOINT_URL": f"http://127.0.0.1:{proxy.port}", "MARSYARD_RETRY_S": "30"}
    kinds = ("broken", "busy", "lost", "deaf", "dropped", "cut", "short", "slow", "conflict")
    proxy.faults = {kind: 0.04 for kind in kinds}
    bench.run("generate", CONFIG, "--out", url, env=env)
    bench.run("verify", url, env=env)
    bench.run("train", url, *SMALL, "--out", f"run-{name}", env=env)
    proxy.faults = {}
    same_files(bucket.files(name), whole, "built through faults")
    expect((bench.scratch / f"run-{name}/model.safetensors").read_bytes() == model, "trained through faults: another model")


def check_google(bench, bucket, proxy, whole):
    """gs:// in Google's XML dialect, its precondition and token put into S3's words by the proxy: paths, listings and puts, not
    Google itself."""
    proxy.google, proxy.faults = True, {}
    env = {"GOOGLE_BASE_URL": f"http://127.0.0.1:{proxy.port}", "GOOGLE_BEARER_TOKEN": TOKEN}
    url = f"gs://{BUCKET}/google"
    bench.run("generate", CONFIG, "--out", url, env=env)
    bench.run("verify", url, env=env)
    same_files(bucket.files("google"), whole, "gs://")
    proxy.google = False


def check_secrets(bench, bucket):
    """Nothing that was said or written holds a key."""
    said = "\n".join(bench.said).encode()
    files = list(in_folder(bench.scratch).values())
    stored = [data for prefix in ("corpus", "faulty-0", "runs", "judged") for data in bucket.files(prefix).values()]
    for secret in (SECRET, TOKEN, KEY, AZURE_KEY):
        hits = sum(secret.encode() in text for text in [said, *files, *stored])
        expect(hits == 0, f"a key or token stands in {hits} outputs or files")
    return len(files) + len(stored)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("marsyard")
    parser.add_argument("--faulty-builds", type=int, default=1)
    parser.add_argument("--kills", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--results", type=pathlib.Path, help="write what was injected and found as JSON")
    args = parser.parse_args()
    begun, port = time.monotonic(), free_port()
    moto = start_moto(port)
    proxy = FaultyProxy(port, args.seed)
    try:
        with tempfile.TemporaryDirectory() as scratch:
            bench, bucket = Bench(args.marsyard, scratch), Bucket(port)
            endpoint = {"AWS_ENDPOINT_URL": f"http://127.0.0.1:{port}"}
            bench.run("generate", CONFIG, "--out", "local")
            whole = in_folder(bench.scratch / "local")
            name, url = "corpus", f"s3://{BUCKET}/corpus"
            since = time.monotonic()
            bench.run("generate", CONFIG, "--out", url, env=endpoint)
            seconds = time.monotonic() - since
            same_files(bucket.files(name), whole, "built in a bucket")
            bench.run("generate", CONFIG, "--out", f"file://{scratch}/by%20url")
            same_files(in_folder(bench.scratch / "by url"), whole, "file://")
            corpus_id = json.loads(whole["manifest.json"])["corpus_id"]
            say(f"{len(whole)} files in the bucket are the folder's; corpus_id {corpus_id[:16]}", begun)
            check_verbs(bench, bucket, "local", url, endpoint)
            model = (bench.scratch / "run-local/model.safetensors").read_bytes()
            say("every verb that reads a corpus, a model or a cloud reads it from a URL as from a folder", begun)
            check_refusals(bench, url, endpoint, proxy)
            check_profile(bench, url, port)
            say("refused with exit 2: no bucket, no keys, wrong keys, plain http, keys in URLs; profiles are read", begun)
            check_hostile(bench, bucket, url, proxy)
            say("redirects, floods, flipped bits and strange certificates are refused at once", begun)
            check_damage(bench, bucket, name, url, endpoint, whole)
            check_height_map(bench, bucket, endpoint)
            say("removed, changed and foreign objects are found and repaired; plans with files beside them", begun)
            check_kills(bench, bucket, endpoint, whole, args.kills, args.seed, seconds)
            check_two(bench, bucket, endpoint, whole)
            say(f"killed {args.kills} times and resumed, and two builds at once: the same bytes", begun)
            check_endless(bench, url, proxy)
            say("faults without end: exit 75 in bounded time", begun)
            proxy.injected.clear()
            for number in range(args.faulty_builds):
                check_faulty(bench, bucket, proxy, whole, number, model)
            injected = dict(sorted(proxy.injected.items()))
            say(f"{args.faulty_builds} builds and trainings through faults, nothing lost: {injected}", begun)
            check_google(bench, bucket, proxy, whole)
            say("gs:// through a translation to S3: the same bytes", begun)
            looked_at = check_secrets(bench, bucket)
            say(f"no key in {len(bench.said)} outputs and {looked_at} files", begun)
            if args.results:
                found = {"server": f"moto {importlib.metadata.version('moto')}", "builds_through_faults": args.faulty_builds,
                         "injected": injected, "kills": args.kills, "builds_at_once": 2, "lost": 0,
                         "corpus_id": corpus_id, "outputs_without_a_key": len(bench.said),
                         "files_without_a_key": looked_at}
                args.results.write_text(json.dumps(found, indent=2) + "\n")
    finally:
        proxy.close()
        moto.kill()
        moto.wait()


if __name__ == "__main__":
    main()
