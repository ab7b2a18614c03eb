from . import plots as plots
from . import viewer as viewer
from .summary import summarize as summarize
from .viewer import draw as draw
from .viewer import view as view
from .viewer import view_forces as view_forces
from .viewer import write_animation as write_animation
from .viewer import write_video as write_video
