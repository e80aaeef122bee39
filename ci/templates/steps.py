"""Prints the shell steps of a GitHub or GitLab file, one per line, in order."""

import sys

from ruamel.yaml import YAML

document = YAML(typ="safe").load(open(sys.argv[1]))
jobs = document.get("jobs") or {name: value for name, value in document.items() if name == "runs"}
github = [step["run"] for job in jobs.values() for step in job.get("steps", []) if "run" in step]
shared = document.get(".mesh", {}).get("before_script", [])
gitlab = [shared + job["script"] for job in document.values() if isinstance(job, dict) and "script" in job]
for step in github + [line for lines in gitlab for line in lines]:
    print("; ".join(step.strip().splitlines()))
