from .cycles import (
    bistable_band as bistable_band,
)
from .cycles import (
    cycle_branch as cycle_branch,
)
from .cycles import (
    lasting as lasting,
)
from .cycles import (
    lasting_delay as lasting_delay,
)
from .cycles import (
    lasting_velocities as lasting_velocities,
)
from .cycles import (
    lasts as lasts,
)
from .errors import (
    InputError as InputError,
)
from .errors import (
    UndecidedError as UndecidedError,
)
from .io.files import (
    load as load,
)
from .io.files import (
    save as save,
)
from .measure import (
    amplitude as amplitude,
)
from .measure import (
    event_statistics as event_statistics,
)
from .measure import (
    events as events,
)
from .measure import (
    hysteresis as hysteresis,
)
from .measure import (
    read_trace as read_trace,
)
from .measure import (
    regime as regime,
)
from .measure import (
    transitions as transitions,
)
from .model import (
    Contacts as Contacts,
)
from .model import (
    Delay as Delay,
)
from .model import (
    Drive as Drive,
)
from .model import (
    Empirical as Empirical,
)
from .model import (
    Exponential as Exponential,
)
from .model import (
    ExponentialGrowth as ExponentialGrowth,
)
from .model import (
    ForceAbove as ForceAbove,
)
from .model import (
    ForceBelow as ForceBelow,
)
from .model import (
    FromRest as FromRest,
)
from .model import (
    FromSliding as FromSliding,
)
from .model import (
    Gamma as Gamma,
)
from .model import (
    Gaussian as Gaussian,
)
from .model import (
    Interface as Interface,
)
from .model import (
    Langevin as Langevin,
)
from .model import (
    LogarithmicGrowth as LogarithmicGrowth,
)
from .model import (
    LogNormal as LogNormal,
)
from .model import (
    MasterEquation as MasterEquation,
)
from .model import (
    Output as Output,
)
from .model import (
    PaperClosure as PaperClosure,
)
from .model import (
    RandomDelay as RandomDelay,
)
from .model import (
    Scales as Scales,
)
from .model import (
    Slider as Slider,
)
from .model import (
    SteadyState as SteadyState,
)
from .model import (
    Travel as Travel,
)
from .model import (
    Uniform as Uniform,
)
from .model import (
    Weibull as Weibull,
)
from .model import (
    constant as constant,
)
from .model import (
    ramp as ramp,
)
from .rigid import (
    Renewal as Renewal,
)
from .rigid import (
    critical_stiffness as critical_stiffness,
)
from .rigid import (
    effective_stiffness as effective_stiffness,
)
from .rigid import (
    rigid_slide as rigid_slide,
)
from .rigid import (
    static_friction as static_friction,
)
from .simulation import (
    rerun as rerun,
)
from .simulation import (
    simulate as simulate,
)
from .stability import (
    boundary as boundary,
)
from .stability import (
    critical as critical,
)
from .stability import (
    critical_damping as critical_damping,
)
from .stability import (
    critical_delay as critical_delay,
)
from .stability import (
    critical_mass as critical_mass,
)
from .stability import (
    critical_spring as critical_spring,
)
from .stability import (
    critical_std as critical_std,
)
from .stability import (
    critical_velocities as critical_velocities,
)
from .stability import (
    dynamic_stiffness as dynamic_stiffness,
)
from .stability import (
    growth_rate as growth_rate,
)
from .stability import (
    stability_map as stability_map,
)
from .stability import (
    unstable_modes as unstable_modes,
)
from .theory import (
    closure_friction as closure_friction,
)
from .theory import (
    effective_potential as effective_potential,
)
from .theory import (
    kinetic_friction as kinetic_friction,
)

__version__: str
