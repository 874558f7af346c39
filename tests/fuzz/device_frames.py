"""Valid requests to every simulated device, from which the mutated ones are made; Modbus without its frames."""

ESP301_FRAMES = [
    command + b"\r"
    for command in (
        b"VE?",
        b"1ID?;2ID?",
        b"1MO",
        b"1MO;1PA10.5;1WS;1TP?",
        b"2MO;2PA-20.25",
        b"1PR-2.5E1",
        b"1OR4",
        b"1MV+",
        b"2MT-",
        b"1WP3.25",
        b"WT100",
        b"1ST",
        b"AB",
        b"RS",
        b"1DH5",
        b"1VA12.5;1AC40;1AG50;1AE60;1JK100;1OH4",
        b"1VU30;1AU1E3;1FE1",
        b"1SL-5;1SR90;1SL?",
        b"1SN9;1SN?",
        b"1SU?;1QM?;1TV;1DP?;1MD?",
        b"TS;TE?;TB?",
    )
]
ESP301_FRAMES.append(
    b"".join(b"1%s%sE99\r" % (name, b"9" * 60) for name in (b"VU", b"VA", b"AU", b"AC", b"AG")) + b"1MO;1PA5\r"
)
FW102C_FRAMES = [
    b"*idn?\r",
    b"pos?\r",
    b"pos=3\r",
    b"pos=6\r",
    b"pcount=12\r",
    b"pcount?\r",
    b"speed=0\r",
    b"trig=1\r",
]
FW102C_FRAMES += [b"sensors?\r", b"baud=1\r", b"save\r", b"\x1b[A", b"\x1b[B", b"\0\0\r\n"]
PM100_FRAMES = [
    command + b"\n"
    for command in (
        b"*IDN?;*OPC?",
        b"*RST;*CLS",
        b"SYST:ERR?",
        b"SYSTEM:SENSOR:IDN?",
        b"MEAS:POW?",
        b"INIT;FETCH?",
        b"READ?;*ESR?;*STB?",
        b"SENS:POW:UNIT DBM",
        b"SENSE:CORRECTION:WAVELENGTH 550",
        b"SENS:CORR:WAV? MAX",
        b"SENS:AVER:COUN 100;:SENS:AVER?",
        b"SENS:POW:RANG 1.5E-3;RANG:AUTO 1;AUTO?",
        b"SENS:CORR:COLL:ZERO;:SENS:CORR:COLL:ZERO:STAT?",
        b"SENS:CORR -3.5;:INP:FILT ON",
    )
]
SR830_FRAMES = [
    command + b"\r"
    for command in (
        b"OUTX 0;*IDN?",
        b"*RST;*CLS",
        b"*ESR? 5;*STB?",
        b"SNAP? 3,4,9,3,4;LIAS?",
        b"OUTP? 1;OAUX? 2",
        b"SENS 17;SENS?",
        b"OFLT 10;OFSL 3;OFLT?",
        b"FMOD 0;RSLP 2",
        b"FREQ 1.73E+02;HARM 3;PHAS 541",
        b"AUXV 2,-1.5;AUXV? 2",
        b"OEXP 1,-5.5,2;OEXP? 1",
        b"APHS;AGAN;ARSV;AOFF 1",
        b"SYNC 1;ISRC 3",
    )
]
AZ_BODIES = [
    bytes.fromhex(text)
    for text in (
        "01 03 00 CC 00 02",
        "01 03 00 7E 00 04",
        "01 06 00 7D 00 10",
        "01 06 00 7D 00 20",
        "01 06 00 7D 00 00",
        "01 08 00 00 A5 37",
        "01 10 18 02 00 02 04 FF FF FC 18",
        "01 17 18 02 00 02 18 02 00 02 04 00 00 12 34",
        "01 10 00 58 00 10 20 00000000 00000001 00002134 000007D0 000F4240 000F4240 000003E8 00000001",
        "01 10 00 58 00 10 20 00000000 00000009 00001134 000007D0 000F4240 000F4240 000003E8 00000001",
        "00 06 00 7D 00 08",
        "02 03 00 CC 00 02",
        "02 03 04 00 00 21 34",
        "01 2B 0E 01 00",
    )
]
LEC_BODIES = [
    bytes.fromhex(text)
    for text in (
        "01 01 00 10 00 09",
        "01 02 00 40 00 10",
        "01 03 90 00 00 02",
        "01 05 00 30 FF 00",
        "01 05 00 19 FF 00",
        "01 05 00 1C FF 00",
        "01 05 00 1D FF 00",
        "01 08 00 00 A5 37",
        "01 0F 00 10 00 09 02 FF 01",
        "01 10 91 00 00 01 02 01 00",
        "01 10 91 02 00 10 20 0001 001E 00001388 0064 0064 0000 0000 0000 0064 00000000 00000000 00000064",
        "00 05 00 30 FF 00",
        "02 05 00 19 FF 00",
    )
]
APT_FRAMES = [
    bytes.fromhex(text)
    for text in (
        "05 00 00 00 50 01",
        "05 00 00 00 11 01",
        "60 00 00 00 11 01",
        "11 00 00 00 50 01",
        "12 00 00 00 50 01",
        "92 04 00 00 50 01",
        "43 04 01 00 50 01",
        "43 04 01 00 21 01",
        "53 04 06 00 D0 01 01 00 00 C0 5D 00",
        "53 04 06 00 A2 01 01 00 00 C0 5D 00",
        "48 04 06 00 D0 01 01 00 00 10 00 00",
        "57 04 01 02 50 01",
        "6A 04 01 01 50 01",
        "65 04 01 02 50 01",
        "65 04 01 01 22 01",
        "80 04 01 00 50 01",
        "90 04 01 00 50 01",
        "80 04 01 00 22 01",
        "10 02 01 01 50 01",
        "10 02 01 02 50 01",
        "13 04 0E 00 D0 01 01 00 00 00 00 00 AC 3A 00 00 55 55 5E 04",
        "16 04 16 00 D0 01 01 00 02 00 00 C0 0A 00 00 00 00 00 AC 3A 00 00 55 55 5E 04 02 00",
        "40 04 0E 00 D0 01 01 00 02 00 01 00 55 55 5E 04 00 C0 0A 00",
        "14 04 01 00 50 01",
        "10 04 06 00 D0 01 01 00 00 00 00 40",
        "09 04 06 00 A1 01 01 00 00 00 00 40",
        "29 04 01 00 21 01",
    )
]
ELLIPTEC_FRAMES = [
    b"0in",
    b"0gs",
    b"0gp",
    b"0ma00004600",
    b"2mrFFFFEE80",
    b"0ho0",
    b"5ho1",
    b"0fw",
    b"5bw\r\n",
    b"0sv64",
]
ELLIPTEC_FRAMES += [
    b"2gv",
    b"0sj00000000",
    b"0gj",
    b"0so00000100",
    b"0go",
    b"0st",
    b"0ca5",
    b"5ca0",
    b"2gaF",
    b"Fma00004600",
]
ELLIPTEC_FRAMES += [b"0us", b"5is01", b"0i1", b"2s1", b"0f180A0", b"0om", b"5cm", b"0mr00000001"]
