"""The manifests of deploy/agones and deploy/batch against a schema of the keys that they may have, and against each other
and the program: names, labels, ports, flags, counters, metrics. usage: check_manifests.py TREE PALPATE METRICS
"""

import json
import pathlib
import re
import subprocess
import sys

import yaml

tree, palpate, metrics = pathlib.Path(sys.argv[1]), sys.argv[2], pathlib.Path(sys.argv[3]).read_text()
folder = tree / "deploy/agones"
n_passed, faults = 0, []


def check(sentence, holds):
    global n_passed
    if holds:
        n_passed += 1
    else:
        faults.append(sentence)


# A schema is a type, a list of one schema, a set of allowed values, or a table: a key with "!" must be there, and others
# than those named are faults. ANY: what Kubernetes has as a map of texts.
ANY = object()
META = {"name!": str, "labels": ANY}
PORT = {"name": str, "containerPort!": int, "protocol": {"TCP", "UDP"}, "portPolicy": {"Dynamic", "Static", "Passthrough"}}
CONTAINER = {
    "name!": str,
    "image!": str,
    "command": [str],
    "args": [str],
    "env": [{"name!": str, "value": str}],
    "ports": [PORT],
    "readinessProbe": {"httpGet!": {"path!": str, "port!": (int, str)}, "periodSeconds": int},
    "resources": {"requests": ANY, "limits": ANY},
    "securityContext": {
        "allowPrivilegeEscalation!": {False},
        "readOnlyRootFilesystem!": {True},
        "capabilities!": {"drop!": [{"ALL"}]},
    },
    "volumeMounts": [{"name!": str, "mountPath!": str, "readOnly": bool}],
}
POD = {
    "automountServiceAccountToken!": {False},
    "restartPolicy": {"OnFailure"},
    "terminationGracePeriodSeconds": int,
    "securityContext!": {
        "runAsNonRoot!": {True},
        "runAsUser!": int,
        "fsGroup": int,
        "seccompProfile!": {"type!": {"RuntimeDefault"}},
    },
    "initContainers": [CONTAINER],
    "containers!": [CONTAINER],
    "volumes": [
        {
            "name!": str,
            "persistentVolumeClaim": {"claimName!": str},
            "secret": {"secretName!": str},
            "emptyDir": {"medium": {"Memory"}},
        }
    ],
}
RULE_PORTS = [{"protocol!": {"TCP", "UDP"}, "port!": int}]
PEER = [{"podSelector": {"matchLabels": ANY}, "namespaceSelector": {"matchLabels": ANY}}]
SPECS = {
    "agones.dev/v1 Fleet": {
        "replicas!": int,
        "scheduling": {"Packed", "Distributed"},
        "strategy": {"type!": {"RollingUpdate", "Recreate"}, "rollingUpdate": {"maxSurge": str, "maxUnavailable": str}},
        "template!": {
            "metadata": {"labels": ANY},
            "spec!": {
                "ports!": [PORT],
                "health": {"initialDelaySeconds": int, "periodSeconds": int, "failureThreshold": int},
                "counters": ANY,
                "eviction": {"safe!": {"Always", "OnUpgrade", "Never"}},
                "template!": {"metadata": {"labels": ANY}, "spec!": POD},
            },
        },
    },
    "autoscaling.agones.dev/v1 FleetAutoscaler": {
        "fleetName!": str,
        "policy!": {"type!": {"Buffer"}, "buffer!": {"bufferSize!": int, "minReplicas": int, "maxReplicas!": int}},
    },
    "allocation.agones.dev/v1 GameServerAllocation": {
        "scheduling": {"Packed", "Distributed"},
        "selectors!": [{"matchLabels!": ANY, "gameServerState": {"Ready", "Allocated"}, "counters": ANY}],
        "priorities": [{"type!": {"Counter", "List"}, "key!": str, "order!": {"Ascending", "Descending"}}],
        "counters": ANY,
    },
    "networking.k8s.io/v1 NetworkPolicy": {
        "podSelector!": {"matchLabels": ANY},
        "policyTypes!": [{"Ingress", "Egress"}],
        "ingress": [{"from": PEER, "ports": RULE_PORTS}],
        "egress": [{"to": PEER, "ports": RULE_PORTS}],
    },
    "policy/v1 PodDisruptionBudget": {"maxUnavailable": int, "minAvailable": int, "selector!": {"matchLabels": ANY}},
    "v1 Service": {
        "clusterIP": {"None"},
        "selector!": ANY,
        "ports!": [{"name!": str, "port!": int, "targetPort": int, "protocol": {"TCP"}}],
    },
    "monitoring.coreos.com/v1 ServiceMonitor": {
        "selector!": {"matchLabels": ANY},
        "endpoints!": [{"port!": str, "path": str, "interval": str}],
    },
    "batch/v1 Job": {
        "completionMode": {"Indexed"},
        "completions": int,
        "parallelism": int,
        "backoffLimit": int,
        "template!": {"spec!": POD},
    },
}


def fits(value, schema, where):
    if schema is ANY:
        check(f"{where}: not a table", isinstance(value, dict))
    elif isinstance(schema, (type, tuple)):
        # a number where true is meant, or the other way round, is a fault
        check(f"{where}: {value!r}", isinstance(value, schema) and (schema is bool or not isinstance(value, bool)))
    elif isinstance(schema, set):
        check(f"{where}: {value!r}, not one of {schema}", value in schema)
    elif isinstance(schema, list):
        check(f"{where}: not a list", isinstance(value, list) and value != [])
        for k, one in enumerate(value if isinstance(value, list) else []):
            fits(one, schema[0], f"{where}[{k}]")
    elif not isinstance(value, dict):
        check(f"{where}: not a table", False)
    else:
        known = {key.rstrip("!"): sub for key, sub in schema.items()}
        for key in schema:
            if key.endswith("!"):
                check(f"{where}.{key[:-1]} is missing", key[:-1] in value)
        for key, one in value.items():
            check(f"{where}.{key} is unknown", key in known)
            if key in known:
                fits(one, known[key], f"{where}.{key}")


objects = {}
for path in sorted([*folder.glob("*.yaml"), folder / "allocation.json", tree / "deploy/batch/kubernetes_job.yaml"]):
    for document in yaml.safe_load_all(path.read_text()):
        kind = f"{document.get('apiVersion')} {document.get('kind')}"
        check(f"{path.name}: {kind} is unknown", kind in SPECS)
        if kind not in SPECS:
            continue
        whole = {"apiVersion!": str, "kind!": str, "metadata": META, "spec!": SPECS[kind]}
        fits(document, whole, path.name)
        objects[document["kind"]] = document

fleet = objects["Fleet"]
gameserver = fleet["spec"]["template"]["spec"]
pod = gameserver["template"]["spec"]
labels = gameserver["template"]["metadata"]["labels"]
server = pod["containers"][0]
args = dict(arg.partition("=")[::2] for arg in server["args"])
has = lambda selector: selector["matchLabels"].items() <= labels.items()

# the program takes the flags, and listens where the manifests say
help_text = subprocess.run([palpate, "serve", "--help"], capture_output=True, text=True, check=True).stdout
for flag in args:
    check(f"palpate serve has no {flag}", re.search(rf"^  {flag}\b", help_text, re.M))
port = int(args.get("--port") or re.search(r"--port N .*\((\d+)\)", help_text)[1])
health = int(args["--health"].rpartition(":")[2])
check("the fleet's port is not the server's", gameserver["ports"][0]["containerPort"] == port)
check("the health port is not the server's", server["ports"][0]["containerPort"] == health)
check("the probe's port has no name", server["readinessProbe"]["httpGet"]["port"] == server["ports"][0]["name"])
allowed = [p["port"] for rule in objects["NetworkPolicy"]["spec"]["ingress"] for p in rule["ports"]]
check("the network policy's ports are not the server's", sorted(allowed) == sorted([port, health]))
check("the service's port is not that of health", objects["Service"]["spec"]["ports"][0]["port"] == health)
service_ports = [p["name"] for p in objects["Service"]["spec"]["ports"]]
check("the monitor's port is not the service's", objects["ServiceMonitor"]["spec"]["endpoints"][0]["port"] in service_ports)

# volumes, names and labels meet
volumes = {volume["name"] for volume in pod["volumes"]}
for container in pod["containers"] + pod["initContainers"]:
    for mount in container["volumeMounts"]:
        check(f"{container['name']}: no volume {mount['name']}", mount["name"] in volumes)
mounts = [mount["mountPath"] for mount in server["volumeMounts"]]
for flag in ("--keys", "--record"):
    check(f"{flag} is on no volume", str(pathlib.PurePath(args[flag]).parent) in mounts)
check("the autoscaler is of another fleet", objects["FleetAutoscaler"]["spec"]["fleetName"] == fleet["metadata"]["name"])
for selector in objects["GameServerAllocation"]["spec"]["selectors"]:
    check("the allocation is of another fleet", selector["matchLabels"]["agones.dev/fleet"] == fleet["metadata"]["name"])
for kind, key in (("NetworkPolicy", "podSelector"), ("PodDisruptionBudget", "selector")):
    check(f"{kind} does not select the fleet's pods", has(objects[kind]["spec"][key]))
check("the service does not select the fleet's pods", has({"matchLabels": objects["Service"]["spec"]["selector"]}))
service_labels = objects["Service"]["metadata"]["labels"]
monitored = objects["ServiceMonitor"]["spec"]["selector"]["matchLabels"]
check("the monitor does not select the service", monitored.items() <= service_labels.items())

# the counter is the one that the server sets, Agones' health is slower than its pings
source = (tree / "server/agones/agones.c").read_text()
counters = set(gameserver["counters"])
check("the fleet's counter is not the server's", counters == set(re.findall(r"/v1beta1/counters/(\w+)", source)))
check("the allocation's counter is not the fleet's", counters == set(objects["GameServerAllocation"]["spec"]["counters"]))
check("SIGKILL comes before a drain has ended", pod["terminationGracePeriodSeconds"] >= 30)

# what the dashboard shows is measured
dashboard = json.loads((folder / "dashboard.json").read_text())
measured = set(re.findall(r"^(palpate_\w+)", metrics, re.M))
shown = [target["expr"] for panel in dashboard["panels"] for target in panel["targets"]]
for expression in shown:
    for name in re.findall(r"palpate_\w+", expression):
        check(f"the dashboard shows {name}, which no server has", name in measured)
    check(f"unbalanced: {expression}", expression.count("(") == expression.count(")"))
places = [(p["gridPos"]["x"], p["gridPos"]["y"]) for p in dashboard["panels"]]
check("two panels stand in one place", len(set(places)) == len(places) and len(places) >= 6)

for fault in faults:
    print("FAIL", fault)
print(f"{n_passed} passed, {len(faults)} failed")
sys.exit(bool(faults))
