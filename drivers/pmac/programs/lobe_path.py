"""The lines that lead the tool along the lobe, whether the spindle is an axis of the program or its clock.

Four steps: the amplitude grows clear of the part, whole turns are cut, the path is faded into the retracted
position, everything rests. `{y}` is what moves the spindle, empty where something else turns it; `{go_on}` is what
has to hold for another turn.
"""

from __future__ import annotations

SPINDLE_STEP = " Y(P28+P16*P25):(P17)"
"""The word that turns the spindle on in a segment."""

LOBE_PATH = """\
PVT{segment} ; the amplitude grows
P25=0 P45=0
WHILE(P25<P24)
P25=P25+1 P45=P45+1
P26=P25/P24
P27=P14+P13*P25
X(P11+P12*P26*COS(P27)):(-P15*P26*SIN(P27)){y} Z(P21):0
ENDWHILE
P30=0 ; turns begun
P31=P25 ; the segment in which the present turn ends
WHILE(P25<P31 OR {go_on} AND P30<P23)
IF(P25!<P31)
P30=P30+1
P31=P24-0.5+P30*P32
ENDIF
P25=P25+1 P45=P45+1
P27=P14+P13*P25
X(P11+P12*COS(P27)):(-P15*SIN(P27)){y} Z(P21+P18*(P25-P24)):(P19)
ENDWHILE
P43=P30 ; turns of the cut
P29=P21+P18*(P25-P24) ; carriage at the end of the cut
P33=0
IF(P30>0) P33=P19
P34={out_segments} ; the tool goes out, the carriage comes to rest
WHILE(P34>0)
P34=P34-1
P25=P25+1 P45=P45+1
P27=P14+P13*P25
P35=P34/{out_segments} ; from 1 to 0
P36=P35*P35*(3-2*P35) ; what is left of the path
P37=P11+P12*COS(P27)-P20
P38=-P15*SIN(P27)*P36-P37*6*P35*(1-P35)/{out_ms}*1000
X(P20+P37*P36):(P38){y} Z(P29+P33*{out_ms}/3000*(1-P35*P35*P35)):(P33*P35*P35)
ENDWHILE
"""
