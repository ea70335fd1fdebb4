"""First labels by themselves: landmarks of a scan from the lab's own labelled scans, as suggestions.

A labelled scan is prepared once as a template. On a new scan the head's pose is found, each template is
registered deformably onto it, and each landmark is guessed where the templates agree, with a radius. Guesses
are suggestions: nothing counts until a person has confirmed it.
"""

from gp_labeler.autolabel.labelled_scan import LabelledScan
from gp_labeler.autolabel.library import TemplateLibrary
from gp_labeler.autolabel.prediction import HeadNotFoundError
from gp_labeler.autolabel.proposal import Guess, Proposal
from gp_labeler.autolabel.propose import propose

__all__ = ["Guess", "HeadNotFoundError", "LabelledScan", "Proposal", "TemplateLibrary", "propose"]
