import numpy as np, time, sys
import jaxcam, continuation
from jaxcam.models import ImpactOscillator
for om,dmp,r in ((2.4,0.05,0.8),(1.5,0.05,0.8)):
    w0=1/abs(1-om**2)
    w=1.0/np.hypot(1-om**2,2*dmp*om)
    sys_=ImpactOscillator(omega=om,restitution=r,wall=w*1.02,damping=dmp)
    t=time.time()
    o=continuation.periodic_orbit(sys_)
    b=continuation.branch(sys_,o,"wall",(-0.3,w*1.1),direction=-1,settings=continuation.BranchSettings(max_points=60))
    print(om,time.time()-t,w); print(b)
    for p in b.points[:40]:
        print(p.label,p.kind,p.parameter,p.stable,p.multipliers,p.signature, {k:v for k,v in p.tests.items()})
