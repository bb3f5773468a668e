"""Small programs made for the purpose: what each holds is used in public programs, or is refused for a reason."""

from __future__ import annotations

MOTION = (
    *("X10", "X10 Y20 Z-5", "x(p1) y(p2)", "X.5", "X-0.25", "X($10)", "X(P1+Q2*M3)", "A10 B20 C30", "U1 V2 W3"),
    *("INC X10", "ABS X10", "INC(X,Y) X1 Y1", "ABS(Z) Z5", "FRAX(X,Y) F20 X5", "NOFRAX TM50 X5", "FRAX X1"),
    *("LINEAR TA10 TS0 TM100 X5", "ta10ts10tm(P400) X5", "LIN X5", "F(P1*60) X1", "TA(P1) X1"),
    *("RAPID X5", "RPD X5 Y5", "RAPID X(P1)^(P2)", "RAPID X10^-5 Y2^1", "rapid inc x5^(p1)"),
    *("SPLINE1 TA40 X5", "SPLINE2 TM40 X5", "PVT50 X5:0", "PVT(P1) X5:(P2) Y1:0", "PVT20 X5:10\nX5\nDWELL10"),
    *(
        "CIRCLE1 X10 Y10 I5 J5",
        "CIR2 X10 Y10 R5",
        "NORMAL K-1 CIRCLE2 X1 I1",
        "NRM I0 J0 K-1",
        "INC(R) CIRCLE1 X1 I1",
    ),
    *("DWELL10", "DWE 10", "DELAY(P1)", "DLY100", "DWELL0", "WHILE(P1<3) WAIT", "STOP", "BSTART X1 BSTOP"),
    *("HOME1", "HM1..3", "HOMEZ1,2", "HMZ 25..27", "PSET X0 Y0", "PSET X(P1)"),
    *("WHILE(P1<3)\nP1=P1+1\nENDWHILE", "while (p1 !> 3)\np1 = p1 + 1\nend while", "WHILE(P1<3)\nP1=P1+1\nENDW"),
    *(
        "IF(P1=1) X1",
        "IF(P1=1)\nX1\nELSE\nX2\nENDIF",
        "if (p1=1 and m2=0 or q3>1)\nx1\nendi",
        "IF(P1~2) X1\nELSE X2",
    ),
    *("IF(P1!~2) X1", "IF(P1!<2) X1", "IF(P1&2=2) X1", "IF(INT(P1/2)!=P1%2) X1"),
    *(
        "N100 X1",
        "O5 X1",
        "N1\nGOTO1",
        "GOTO(P1)",
        "GOSUB100\nRETURN\nN100 X1\nRET",
        "GOS100\nRETURN\nN100 X1\nRET",
        "CALL 500",
        "CALL500.1 X5 Y6",
    ),
    *("READ(X,Y,A)", "G1 X5", "G(P1)", "M3", "T2", "D7", "G4 P2000", "S1000", "M03 S500 X1"),
    *(
        "P1=5",
        "Q1=P1",
        "M1=1",
        "I5=2",
        "P(P1+1)=3",
        "P1=((P2+1))*(3)",
        "P1=$F|$10",
        "P1=P2^P3",
        "P1=-(P2)",
        "M1==1",
    ),
    *(
        "M1==M1|$F",
        "M1&=3",
        "M1|=3",
        "M1^=3",
        "P1=SIN(30)+COS(Q1)",
        "P1=ATAN2(P2)",
        "P1=SQRT(2)*LN(3)/EXP(1)",
        "P1=11%-4",
    ),
    *(
        'CMD"#1J/"',
        'COMMAND"&1A"',
        'CMDS"P1"',
        "CMD^A",
        'SEND"hello; there"',
        'SENDP"P1"',
        "SEND^M",
        'DISPLAY 3 "text"',
    ),
    *(
        "ENABLE PLC 2",
        "ENA PLC 2,5..7",
        "DISABLE PLC2..31",
        "DIS PLC 2",
        "PAUSE PLC 3",
        "PAU PLC 3",
        "RESUME PLC 3",
        "RES PLC 3",
        "; only a remark",
    ),
    *(
        'COMMANDS"P1"\nCOMMANDP"P1"\nCOMMANDR"P1"\nCOMMANDA"P1"',
        'CMDP"P1"\nCMDR"P1"\nCMDA"P1"',
        'SENDS"a"\nSENDR"b"\nSENDA"c"',
        "CIR1 X10 Y0 I5 J0",
        "BLOCKSTART\nX1\nX2\nBLOCKSTOP",
        "P1=ASIN(P2)+ACOS(P3)",
        "TM100 X5\nTS20 X6",
        "P1=TAN(45)*ATAN(1)+ABS(P2)",
    ),
)
"""Programs that the card takes."""

KINEMATIC = (
    "P4=Q7*100",
    "P4=Q7*COS(Q1)\nP5=Q8",
    "IF(Q10=1)\nP104=Q17*100\nENDIF",
    "WHILE(ABS(Q20)>0.001)\nQ20=Q20/2\nENDWHILE\nP4=Q20",
    "if (q7 > 1) p4=1\nelse p4=2",
    "Q0=Q7\nQ1=ATAN2(Q8)",
    "; only a remark",
)
"""Inverse and forward programs that a Turbo takes."""

REFUSED_KINEMATIC = (
    "X10",
    "DWELL10",
    "LINEAR",
    "GOTO5",
    "N5",
    "M1==1",
    'CMD"#1J+"',
    "CALL5",
    "HOME1",
    "ADR#1",
    "F20",
)
"""Lines that no kinematic program holds."""

PLCS = (
    *(
        "P1=P1+1",
        "IF(P1=1)\nP2=2\nENDIF",
        "if (p1=1) p2=2\nendi",
        "IF(P1=1)\nAND(P2=2)\nOR(P3=3)\nP4=4\nELSE\nP4=5\nENDIF",
    ),
    *("WHILE(M1=0)\nENDWHILE", "ADDRESS#1&2", "ADR&2#4", "ADDRESS#P5", "ADDRESS&P6", "ADR#Q1"),
    *(
        'CMD"#1J+"',
        'COMMANDP"P1"',
        'SEND"a"',
        "DISABLE PLC 5",
        "PAUSE PLC 6",
        "PAU PLC 6",
        "RESUME PLC 6",
        "RES PLC 6",
        "ENABLE PLC 1..3",
        "RETURN",
    ),
    *("I5111=100*8388608/I10", "M(P1)=1", "IF(I5111!>0)\nDIS PLC 4\nENDIF", "P1=P1\nRET"),
    *(
        'COMMANDS"P1"\nCOMMANDR"P1"\nCOMMANDA"P1"',
        'CMDS"P1"\nCMDP"P1"\nCMDR"P1"\nCMDA"P1"',
        'SENDS"a"\nSENDP"b"\nSENDR"c"\nSENDA"d"',
        'DISPLAY 3 "text"\nDISP"text"',
        "ENA PLC 7",
    ),
)
"""PLCs that the card takes."""

REFUSED_MOTION = (
    *(
        "X",
        "XP1",
        "X1 0",
        "X10 bad",
        "IF(P1<=2) X1",
        "IF P1=1 X1",
        "WHILE(P1)",
        "GOTO",
        "DWELL",
        "HOME33",
        "READ(N)",
    ),
    *(
        "P1==1",
        "P1=",
        "P1=5+",
        "P1=SIN 30",
        "X(5",
        'CMD"open',
        "ADDRESS#1",
        "AND(P1=1)",
        "INC(X",
        "FRAX(K)",
        "CC1",
        "!X5",
    ),
    *(
        "LEARN",
        "TSEL1",
        "LOOKAHEAD",
        "DISABLE PLC 32",
        "ENABLE PLC",
        "PAUSE",
        "SPLINE3",
        "CIRCLE3",
        "BLOCK",
        "ABSX",
        "N300000",
    ),
)
"""Lines that no motion program holds."""

REFUSED_PLCS = (
    "X10",
    "DWELL10",
    "LINEAR",
    "GOTO5",
    "N5",
    "M1==1",
    "CALL5",
    "G1",
    "WAIT",
    "HOME1",
    "IF(P1)",
    "ADDRESS",
)
"""Lines that no PLC holds."""

ON_LINE = (
    *(
        "&1E",
        "&1K",
        "DELETE TEMPS",
        "DEFINE UBUFFER 64",
        "DEFINE LOOKAHEAD 500,20",
        "DEL LOOK",
        "DELETE GATHER",
        "CLOSE ALL",
    ),
    *("P1=5 Q2=P1*2", "P(P1+1)=3", "M(P1)=1", "M1->X:$700,24,S", "M2..5->*", "I190..191=0", "10", "&1%100", "%50"),
    *("#1->2000X+10", "#4->0", "UNDEFINE ALL", "&2#4->100A", "MOVETIME", "PAUSE PLC 1", "RESUME PLC 1,2..3"),
    *(
        "WX:$3000,1,2",
        "WP:$10,5",
        "RHX:$3000,2",
        "DIS PLC 2..31",
        "ENA PLC 2",
        "#1J/#2J/",
        "A",
        "&1K",
        "IDNUMBER SID",
    ),
)
REFUSED_ON_LINE = (
    *("FOO", "P1=5 FOO", "DEFINE BLAH 5", "SETPHASE", "ABR", "DELETE ALL TEMPS", "ENABLE PLC 77", "I100==5"),
    *("M1->X:$0,30", "M5->Y:$10,99", "#1->5Q", "KILLX", "JOG", "P(P1=3", "X10", "DWELL 10", "IF(P1=1)"),
)
"""Lines outside of the buffers."""

PREPROCESSED = (
    "#define SPEED 20\n#define OUT M1\nOPEN PROG 1 CLEAR\nF(SPEED) X10\nOUT=1\nCLOSE",
    "#define A 1\n#ifdef A\nOPEN PROG 1 CLEAR\nX(A)\n#else\nFOO\n#endif\nCLOSE",
    "#ifndef A\n#define A\n#endif\n&1OPEN PROG 1 CLEAR\n#ifdef A\nX1 ; FOO\n#endif\nCLOSE ALL",
    '#define GO J/\nOPEN PLC 1 CLEAR\nCMD"#1 GO"\nCLOSE\nOPEN PROG 1 CLEAR\nCLOSE',
)
"""Whole texts with directives of the maker's editor."""
