"""Design of the next run: the voltage that separates alternatives and narrows parameters.

proposal = propose(task_of_result(read_result("out/motor").result, DesignOptions()))
Path("next.csv").write_text(profile_csv(proposal))

models.py     models of a result or a nameplate, their covariance, and the quantity to narrow
task.py       models, quantity, limits and grid of the run
profiles.py   families of voltage profiles, and voltages of a limited slew rate
response.py   readings and sensitivities of a candidate
criteria.py   expected information about parameters and models
propose.py    search of the best profile, scaled until every draw holds the limits
output.py     CSV, JSON and sentences
"""

from identification.design.output import profile_csv, proposal_entry, summary
from identification.design.propose import Proposal, propose
from identification.design.task import DesignOptions, Task, task_of_nameplate, task_of_result

__all__ = [
    "DesignOptions",
    "Proposal",
    "Task",
    "profile_csv",
    "propose",
    "proposal_entry",
    "summary",
    "task_of_nameplate",
    "task_of_result",
]
