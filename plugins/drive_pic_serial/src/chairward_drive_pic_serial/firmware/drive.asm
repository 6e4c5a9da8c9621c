; Chairward motor controller: PIC16F877A at 20 MHz, gpasm absolute mode. Pin map, wiring and protocol: the plugin's README.
; Everything is polled, no interrupts: one loop that receives a byte, runs the 1 ms tick, sends a byte.
; Safe by construction: a bridge input is only ever set while ARMED, and ARMED ends by itself 195 ms after the last
; valid motion command. The Python model (model.py) follows this file step by step; change both together.
        list    p=16f877a
        #include <p16f877a.inc>
        __CONFIG _HS_OSC & _WDT_ON & _PWRTE_ON & _BODEN_ON & _LVP_OFF & _CPD_OFF & _WRT_OFF & _CP_OFF
        errorlevel -302

PROTO   equ     .1
TIMEOUT equ     .195            ; ms of silence until the motion watchdog bites (never later than 196 ms)
DEAD    equ     .20             ; ms with the bridge off where a motor has come to a stop before anything else
SWITCH  equ     .2              ; ms with the bridge off between braking and driving, either way
PARK    equ     .250            ; ms at rest until the brake pin falls in (also: "applied" marker)
DEBNCE  equ     .3              ; ms an input must be high to count
RISE    equ     .8              ; default ms for each step of 1/100 faster
FALL    equ     .5              ; default ms for each step of 1/100 slower
RATEMAX equ     .50
SOFT    equ     .10             ; below this many hundredths a motor speeds up at half the rate: no jerk at the start

T_DRIVE equ     0x01            ; steer, drive
T_HELLO equ     0x02            ; rise, fall
T_ESTOP equ     0x03
T_CLEAR equ     0x04            ; nonce high, low
T_BRAKE equ     0x05            ; 0 keep state, 1 leave ARMED
R_STAT  equ     0x81            ; state, fault, steer, drive, battery, inputs
R_HELLO equ     0x82            ; protocol, state, nonce high, low, reason, timeout
R_NAK   equ     0xFF            ; why, state, fault, last seq, 0, 0
E_CRC   equ     .1
E_FRAME equ     .2
E_TYPE  equ     .3
E_RANGE equ     .4
E_STATE equ     .5
E_SEQ   equ     .6
E_NONCE equ     .7
E_CHARG equ     .8
S_BOOT  equ     .0              ; no HELLO yet
S_NEUT  equ     .1              ; waits for DRIVE 0,0
S_ARMED equ     .2
S_ESTOP equ     .3              ; latched
B_TIMEO equ     0               ; fault bits: silence
B_INPUT equ     1               ;             stop input
B_HOST  equ     2               ;             e-stop by the host
B_STOP  equ     0               ; input bits: stop input is active
B_CHARG equ     1               ;             charger is connected
B_BRAKE equ     2               ;             brake pin is applied
B_STAND equ     3               ;             both motors stand
F_RISE  equ     0               ; flags: this tick may step up
F_FALL  equ     1               ;        this tick may step down
F_SOFT  equ     2               ;        this tick may step up even a motor that has only just started
RXMAX   equ     .12
TXLEN   equ     .8
RING    equ     0xA0            ; 64 bytes in bank 1, reached through FSR
RINGMSK equ     0x3F
RINGMAX equ     .51             ; more than this waiting: no room for one more reply of 12

        cblock 0x20
rem                             ; COBS: bytes left in the block
first                           ;       no byte of a frame yet
idx
rerr
crch
crcl
tmp
x
swp
tick_to
state
fault
inputs
battery
seq
last                            ; newest sequence number obeyed
i
j
n
head
tail
pd                              ; PORTD as it shall be
ch
flags
rise
fall
rise_c
fall_c
soft                            ; bit 0 turns with every step up
park
stop_c
chg_c
st_t                            ; steer: target, applied, dead, held
st_a
st_d
st_h
dr_t                            ; drive: the same
dr_a
dr_d
dr_h
wt                              ; the motor in work
wa
wd
wh
        endc
rxbuf   equ     0x50            ; 12
txbuf   equ     0x5C            ; 10

        cblock 0x70             ; the same in all banks
nonce_h
nonce_l
reason
boot_s
        endc

        org     0
        goto    init
        org     4
        retfie

; ---------------------------------------------------------------- reset: pins first, then everything else
init    movf    STATUS,W        ; nTO tells a watchdog reset; read before any clrwdt
        movwf   boot_s
        banksel PORTD
        clrf    PORTD           ; ports keep their latch through a watchdog reset: clear before TRIS, or the bridge glitches on
        clrf    PORTC
        clrf    CCP1CON
        clrf    CCP2CON
        banksel TRISD
        movlw   b'01000000'     ; RD0-3 bridge, RD4 armed, RD5 fault, RD7 brake release
        movwf   TRISD
        movlw   b'10111001'     ; RC6 TX out, RC7 RX in, RC1 and RC2 PWM out
        movwf   TRISC
        movlw   0xFF
        movwf   TRISB           ; RB0 stop input, RB1 charger, both with pull-up
        movwf   TRISA
        movlw   b'01011011'     ; pull-ups on, watchdog 1:8 (144 ms; 56..264 ms over all parts)
        movwf   OPTION_REG
        clrwdt
        movlw   b'00001110'     ; AN0 analog, left justified
        movwf   ADCON1
        movlw   .21             ; 56818 Bd
        movwf   SPBRG
        movlw   (1<<TXEN)|(1<<BRGH)
        movwf   TXSTA
        movlw   .249            ; PWM of 250 steps, 5 kHz
        movwf   PR2
        movlw   .3              ; why were we reset: 0 power, 1 brown-out, 2 watchdog, 3 reset pin
        btfss   boot_s,NOT_TO
        movlw   .2
        btfss   PCON,NOT_BOR
        movlw   .1
        btfss   PCON,NOT_POR
        movlw   .0
        movwf   reason
        bsf     PCON,NOT_POR
        bsf     PCON,NOT_BOR
        banksel PORTD
        movlw   0x20            ; clear RAM 0x20-0x6F
        movwf   FSR
clr     clrf    INDF
        incf    FSR,F
        movlw   0x70
        xorwf   FSR,W
        btfss   STATUS,Z
        goto    clr

; boot nonce: a 16-bit count of resets in EEPROM, high byte at 0
        movlw   .0
        call    ee_read
        movwf   nonce_h
        movlw   .1
        call    ee_read
        movwf   nonce_l
        incfsz  nonce_l,F
        goto    nonce_w
        incf    nonce_h,F
        banksel EEADR
        clrf    EEADR
        movf    nonce_h,W
        call    ee_write
nonce_w banksel EEADR
        movlw   .1
        movwf   EEADR
        movf    nonce_l,W
        call    ee_write

        banksel PORTD
        movlw   RISE
        movwf   rise
        movwf   rise_c
        movlw   FALL
        movwf   fall
        movwf   fall_c
        movlw   PARK
        movwf   park
        movlw   .1
        movwf   first
        movwf   st_h
        movwf   dr_h
        movlw   b'10000001'     ; ADC on, Fosc/32, channel 0
        movwf   ADCON0
        movlw   0x0C
        movwf   CCP1CON
        movwf   CCP2CON
        movlw   b'00100101'     ; TMR2 on, 1:4, post 1:5: PWM 5 kHz, tick 1 ms
        movwf   T2CON
        movlw   (1<<SPEN)|(1<<CREN)
        movwf   RCSTA
        call    outputs
        clrf    seq
        movlw   .0              ; ends whatever the line made up while it had no driver
        call    put
        call    r_hello         ; announce the reset

main    btfsc   PIR1,RCIF
        call    rx
        btfsc   PIR1,TMR2IF
        call    tick            ; the only place that feeds the watchdog: a dead loop or a dead timer both reset
        call    txpump
        goto    main

; ---------------------------------------------------------------- EEPROM
ee_read banksel EEADR
        movwf   EEADR
        banksel EECON1
        bcf     EECON1,EEPGD
        bsf     EECON1,RD
        banksel EEDATA
        movf    EEDATA,W
        banksel PORTD
        return

ee_write
        movwf   EEDATA          ; bank of EEADR is selected
        banksel EECON1
        bcf     EECON1,EEPGD
        bsf     EECON1,WREN
        movlw   0x55
        movwf   EECON2
        movlw   0xAA
        movwf   EECON2
        bsf     EECON1,WR
ee_wait clrwdt                  ; 4-8 ms, outputs are off
        btfsc   EECON1,WR
        goto    ee_wait
        bcf     EECON1,WREN
        banksel PORTD
        return

; ---------------------------------------------------------------- tick, every 1 ms
tick    bcf     PIR1,TMR2IF
        clrwdt
        btfsc   ADCON0,GO
        goto    tk_in
        movf    ADRESH,W
        movwf   battery
        bsf     ADCON0,GO

tk_in   btfsc   PORTB,0         ; stop input: normally closed contact to ground; open, pressed or broken is high
        goto    tk_s1
        clrf    stop_c
        bcf     inputs,B_STOP
        goto    tk_ch
tk_s1   movlw   DEBNCE
        subwf   stop_c,W
        btfsc   STATUS,C
        goto    tk_ch           ; already counted
        incf    stop_c,F
        movlw   DEBNCE
        xorwf   stop_c,W
        btfss   STATUS,Z
        goto    tk_ch
        bsf     inputs,B_STOP
        bsf     fault,B_INPUT
        call    latch
        call    r_event

tk_ch   btfsc   PORTB,1         ; charger: the socket's own contact to ground opens
        goto    tk_c1
        clrf    chg_c
        bcf     inputs,B_CHARG
        goto    tk_wd
tk_c1   movlw   DEBNCE
        subwf   chg_c,W
        btfsc   STATUS,C
        goto    tk_wd
        incf    chg_c,F
        movlw   DEBNCE
        xorwf   chg_c,W
        btfss   STATUS,Z
        goto    tk_wd
        bsf     inputs,B_CHARG
        call    disarm
        call    r_event

tk_wd   movf    tick_to,F
        btfsc   STATUS,Z
        goto    tk_slew
        decfsz  tick_to,F
        goto    tk_slew
        bsf     fault,B_TIMEO
        call    disarm
        call    r_event

tk_slew clrf    flags
        decfsz  rise_c,F
        goto    tk_f
        movf    rise,W
        movwf   rise_c
        bsf     flags,F_RISE
        incf    soft,F
        btfsc   soft,0
        bsf     flags,F_SOFT
tk_f    decfsz  fall_c,F
        goto    tk_m
        movf    fall,W
        movwf   fall_c
        bsf     flags,F_FALL

tk_m    movf    st_t,W
        movwf   wt
        movf    st_a,W
        movwf   wa
        movf    st_d,W
        movwf   wd
        movf    st_h,W
        movwf   wh
        call    motor
        movf    wa,W
        movwf   st_a
        movf    wd,W
        movwf   st_d
        movf    wh,W
        movwf   st_h
        movf    dr_t,W
        movwf   wt
        movf    dr_a,W
        movwf   wa
        movf    dr_d,W
        movwf   wd
        movf    dr_h,W
        movwf   wh
        call    motor
        movf    wa,W
        movwf   dr_a
        movf    wd,W
        movwf   dr_d
        movf    wh,W
        movwf   dr_h

        movf    st_t,W          ; any motion asked or left: brake off; both held: count until it falls in
        iorwf   st_a,W
        iorwf   dr_t,W
        iorwf   dr_a,W
        btfsc   STATUS,Z
        goto    tk_rest
        clrf    park
        goto    outputs
tk_rest movf    st_h,W
        andwf   dr_h,W
        btfsc   STATUS,Z
        goto    outputs
        movlw   PARK
        xorwf   park,W
        btfss   STATUS,Z
        incf    park,F
        goto    outputs

; one motor one tick further: wt target, wa applied, wd ms with the bridge off, wh held by the short-brake
motor   movf    wd,F
        btfsc   STATUS,Z
        goto    mo_1
        decf    wd,F
        return
mo_1    movf    wa,F
        btfss   STATUS,Z
        goto    mo_run
        movf    wt,F
        btfss   STATUS,Z
        goto    mo_go
        movlw   .1              ; at rest and to stay so
        movwf   wh
        return
mo_go   btfss   wh,0
        goto    mo_up0
        clrf    wh              ; release the short-brake before driving
        movlw   SWITCH
        movwf   wd
        return
mo_up0  btfss   flags,F_RISE
        return
        movlw   0x01
        btfsc   wt,7
        movlw   0xFF
        movwf   wa
        return
mo_run  movf    wt,F
        btfsc   STATUS,Z
        goto    mo_down
        movf    wt,W
        xorwf   wa,W
        movwf   tmp
        btfsc   tmp,7
        goto    mo_down         ; other direction: first to rest
        movf    wa,W
        subwf   wt,W
        btfsc   STATUS,Z
        return
        movwf   tmp
        movf    wa,W
        xorwf   tmp,F
        btfsc   tmp,7
        goto    mo_down
        btfss   flags,F_RISE
        return
        movf    wa,W
        btfsc   wa,7
        sublw   .0
        sublw   SOFT-1
        btfss   STATUS,C
        goto    mo_up
        btfss   flags,F_SOFT
        return
mo_up   btfsc   wa,7
        goto    mo_upn
        incf    wa,F
        return
mo_upn  decf    wa,F
        return
mo_down btfss   flags,F_FALL
        return
        btfsc   wa,7
        goto    mo_dnn
        decf    wa,F
        goto    mo_z
mo_dnn  incf    wa,F
mo_z    movf    wa,F
        btfss   STATUS,Z
        return
        movlw   DEAD
        movwf   wd
        return

; ---------------------------------------------------------------- stopping
latch   movlw   S_ESTOP
        movwf   state
        goto    standby
disarm  movlw   S_ARMED
        xorwf   state,W
        btfss   STATUS,Z
        goto    standby
        movlw   S_NEUT
        movwf   state
standby clrf    tick_to
brake   clrf    st_t            ; hard stop: targets and applied values 0, bridge off for a moment, brake pin now
        clrf    dr_t
        movf    st_a,F
        btfsc   STATUS,Z
        goto    br_1
        clrf    st_a
        clrf    st_h
        movlw   SWITCH
        movwf   st_d
br_1    movf    dr_a,F
        btfsc   STATUS,Z
        goto    br_2
        clrf    dr_a
        clrf    dr_h
        movlw   SWITCH
        movwf   dr_d
br_2    movlw   PARK
        movwf   park

; pins from applied values; both PWM registers, then all of PORTD in one write
outputs clrf    pd
        movlw   S_ARMED
        xorwf   state,W
        btfsc   STATUS,Z
        bsf     pd,4
        movf    fault,F
        btfss   STATUS,Z
        bsf     pd,5
        bcf     inputs,B_BRAKE
        movlw   PARK
        xorwf   park,W
        btfsc   STATUS,Z
        bsf     inputs,B_BRAKE
        btfss   inputs,B_BRAKE
        bsf     pd,7            ; release is high: a reset, a broken wire and a dead board brake
        bcf     inputs,B_STAND
        movf    st_a,W
        iorwf   dr_a,W
        btfsc   STATUS,Z
        bsf     inputs,B_STAND
        movf    st_a,W
        movwf   tmp
        movf    st_h,W
        movwf   x
        btfsc   tmp,7
        bsf     pd,1            ; right
        call    duty
        btfsc   n,0
        bsf     pd,0            ; left
        movwf   CCPR1L
        movf    dr_a,W
        movwf   tmp
        movf    dr_h,W
        movwf   x
        btfsc   tmp,7
        bsf     pd,3            ; backward
        call    duty
        btfsc   n,0
        bsf     pd,2            ; forward
        movwf   CCPR2L
        movf    pd,W
        movwf   PORTD
        return

; tmp applied, x held -> W = PWM steps 0..250, n.0 = applied is positive
duty    clrf    n
        movf    tmp,F
        btfss   STATUS,Z
        goto    du_1
        movlw   .0
        btfsc   x,0
        movlw   .250            ; inputs equal and bridge on: short-brake
        return
du_1    btfss   tmp,7
        goto    du_2
        comf    tmp,F
        incf    tmp,F
        goto    du_3
du_2    bsf     n,0
du_3    bcf     STATUS,C        ; 2.5 * |applied|
        rrf     tmp,W
        addwf   tmp,W
        addwf   tmp,W
        return

; ---------------------------------------------------------------- receive: COBS, streaming
rx      btfss   RCSTA,OERR
        goto    rx1
        bcf     RCSTA,CREN
        bsf     RCSTA,CREN
        bsf     rerr,0
        return
rx1     btfsc   RCSTA,FERR
        bsf     rerr,0
        movf    RCREG,W
        movwf   tmp
        movf    tmp,F
        btfsc   STATUS,Z
        goto    rx_end
        movf    rem,F
        btfss   STATUS,Z
        goto    rx_dat
        movf    first,F         ; a code byte
        btfss   STATUS,Z
        goto    rx_c1
        movlw   .0
        call    append
rx_c1   clrf    first
        decf    tmp,W
        movwf   rem
        return
rx_dat  decf    rem,F
        movf    tmp,W
append  movwf   x
        movlw   RXMAX
        subwf   idx,W
        btfsc   STATUS,C
        goto    app_ov
        movlw   rxbuf
        addwf   idx,W
        movwf   FSR
        movf    x,W
        movwf   INDF
        incf    idx,F
        return
app_ov  bsf     rerr,0
        return

rx_end  movf    rerr,F
        btfss   STATUS,Z
        goto    bad_fr
        movf    first,F
        btfss   STATUS,Z
        goto    rx_rst          ; empty frame: a spare delimiter
        movf    rem,F
        btfss   STATUS,Z
        goto    bad_fr
        movlw   .4
        subwf   idx,W
        btfss   STATUS,C
        goto    bad_fr
        call    txpump          ; here and below: keep the sender fed while a frame is worked on (uses FSR)
        call    crcinit
        movlw   rxbuf
        movwf   FSR
        movf    idx,W
        movwf   i
rx_crc  movf    INDF,W
        call    crcb
        incf    FSR,F
        decfsz  i,F
        goto    rx_crc
        movf    crch,W
        iorwf   crcl,W
        btfss   STATUS,Z
        goto    bad_crc
        call    frame
rx_rst  clrf    idx
        clrf    rem
        clrf    rerr
        movlw   .1
        movwf   first
        return
bad_crc movlw   E_CRC
        goto    bad
bad_fr  movlw   E_FRAME
bad     clrf    seq             ; whose it was is not known
        call    nak
        goto    rx_rst

; ---------------------------------------------------------------- frames: length, sequence, range, state; then obey
frame   movf    rxbuf+1,W
        movwf   seq
        movf    rxbuf,W
        xorlw   T_DRIVE
        btfsc   STATUS,Z
        goto    f_drive
        movf    rxbuf,W
        xorlw   T_HELLO
        btfsc   STATUS,Z
        goto    f_hello
        movf    rxbuf,W
        xorlw   T_ESTOP
        btfsc   STATUS,Z
        goto    f_estop
        movf    rxbuf,W
        xorlw   T_CLEAR
        btfsc   STATUS,Z
        goto    f_clear
        movf    rxbuf,W
        xorlw   T_BRAKE
        btfsc   STATUS,Z
        goto    f_brake
        ifdef HANGTEST
        movf    rxbuf,W
        xorlw   0x7E
        btfsc   STATUS,Z
        goto    $
        endif
        movlw   E_TYPE
        goto    nak

f_hello movlw   .6
        xorwf   idx,W
        btfss   STATUS,Z
        goto    e_frame
        movf    rxbuf+2,W       ; 1..50
        call    rate
        btfss   STATUS,C
        goto    e_range
        movf    rxbuf+3,W
        call    rate
        btfss   STATUS,C
        goto    e_range
        movf    rxbuf+2,W
        movwf   rise
        movwf   rise_c
        movf    rxbuf+3,W
        movwf   fall
        movwf   fall_c
        movf    seq,W
        movwf   last
        bcf     fault,B_TIMEO
        movlw   S_ESTOP
        xorwf   state,W
        btfsc   STATUS,Z
        goto    fh_1            ; the latch survives HELLO
        movlw   S_NEUT
        movwf   state
fh_1    call    standby
r_hello movlw   R_HELLO
        movwf   txbuf
        movf    seq,W
        movwf   txbuf+1
        movlw   PROTO
        movwf   txbuf+2
        movf    state,W
        movwf   txbuf+3
        movf    nonce_h,W
        movwf   txbuf+4
        movf    nonce_l,W
        movwf   txbuf+5
        movf    reason,W
        movwf   txbuf+6
        movlw   TIMEOUT
        movwf   txbuf+7
        goto    send
rate    addlw   0xFF            ; C set where W is 1..RATEMAX
        sublw   RATEMAX-1
        return

f_estop movlw   .4
        xorwf   idx,W
        btfss   STATUS,Z
        goto    e_frame
        bsf     fault,B_HOST
        call    latch
        goto    r_stat

f_clear movlw   .6
        xorwf   idx,W
        btfss   STATUS,Z
        goto    e_frame
        call    window
        btfss   STATUS,C
        goto    e_seq
        movf    rxbuf+2,W
        xorwf   nonce_h,W
        btfss   STATUS,Z
        goto    e_nonce
        movf    rxbuf+3,W
        xorwf   nonce_l,W
        btfss   STATUS,Z
        goto    e_nonce
        movlw   S_BOOT
        xorwf   state,W
        btfsc   STATUS,Z
        goto    e_state
        btfsc   inputs,B_STOP
        goto    e_state         ; still pressed
        call    standby
        bcf     fault,B_INPUT
        bcf     fault,B_HOST
        movlw   S_NEUT
        movwf   state
        call    outputs
        goto    r_stat

f_brake movlw   .5
        xorwf   idx,W
        btfss   STATUS,Z
        goto    e_frame
        call    window
        btfss   STATUS,C
        goto    e_seq
        movlw   .2
        subwf   rxbuf+2,W
        btfsc   STATUS,C
        goto    e_range
        btfsc   rxbuf+2,0
        goto    fb_1
        call    brake
        movlw   S_ARMED
        xorwf   state,W
        btfss   STATUS,Z
        goto    r_stat
        movlw   TIMEOUT         ; a motion command like any other
        movwf   tick_to
        goto    r_stat
fb_1    call    disarm
        goto    r_stat

f_drive movlw   .6
        xorwf   idx,W
        btfss   STATUS,Z
        goto    e_frame
        call    window
        btfss   STATUS,C
        goto    e_seq
        movlw   .100            ; -100..100: (v + 100) <= 200 unsigned
        addwf   rxbuf+2,W
        sublw   .200
        btfss   STATUS,C
        goto    e_range
        movlw   .100
        addwf   rxbuf+3,W
        sublw   .200
        btfss   STATUS,C
        goto    e_range
        movlw   S_ARMED
        xorwf   state,W
        btfsc   STATUS,Z
        goto    fd_go
        movlw   S_NEUT
        xorwf   state,W
        btfss   STATUS,Z
        goto    e_state
        movf    rxbuf+2,W       ; arming needs neutral
        iorwf   rxbuf+3,W
        btfss   STATUS,Z
        goto    e_state
        btfsc   inputs,B_CHARG
        goto    e_charg
        movlw   S_ARMED
        movwf   state
        bcf     fault,B_TIMEO
        call    outputs
fd_go   movlw   TIMEOUT
        movwf   tick_to
        movf    rxbuf+2,W
        movwf   st_t
        movf    rxbuf+3,W
        movwf   dr_t
        goto    r_stat

; C set where seq is 1..127 after the last; then it is the last
window  movf    last,W
        subwf   seq,W
        addlw   0xFF
        sublw   .126
        btfss   STATUS,C
        return
        movf    seq,W
        movwf   last
        return                  ; movf and movwf leave C

; ---------------------------------------------------------------- replies
r_event clrf    seq             ; nobody asked
r_stat  movlw   R_STAT
        movwf   txbuf
        movf    seq,W
        movwf   txbuf+1
        movf    state,W
        movwf   txbuf+2
        movf    fault,W
        movwf   txbuf+3
        movf    st_a,W
        movwf   txbuf+4
        movf    dr_a,W
        movwf   txbuf+5
        movf    battery,W
        movwf   txbuf+6
        movf    inputs,W
        movwf   txbuf+7
        goto    send
e_frame movlw   E_FRAME
        goto    nak
e_range movlw   E_RANGE
        goto    nak
e_state movlw   E_STATE
        goto    nak
e_seq   movlw   E_SEQ
        goto    nak
e_nonce movlw   E_NONCE
        goto    nak
e_charg movlw   E_CHARG
nak     movwf   txbuf+2
        movlw   R_NAK
        movwf   txbuf
        movf    seq,W
        movwf   txbuf+1
        movf    state,W
        movwf   txbuf+3
        movf    fault,W
        movwf   txbuf+4
        movf    last,W
        movwf   txbuf+5
        clrf    txbuf+6
        clrf    txbuf+7

; CRC and COBS into the ring; a reply that has no room is dropped whole
send    movf    tail,W
        subwf   head,W
        andlw   RINGMSK
        sublw   RINGMAX
        btfss   STATUS,C
        return
        call    txpump
        call    crcinit
        movlw   txbuf
        movwf   FSR
        movlw   TXLEN
        movwf   i
sn1     movf    INDF,W
        call    crcb
        incf    FSR,F
        decfsz  i,F
        goto    sn1
        movf    crch,W
        movwf   txbuf+TXLEN
        movf    crcl,W
        movwf   txbuf+TXLEN+1
        call    txpump
        clrf    i
blk     movf    i,W
        movwf   j
        movlw   .1
        movwf   n
cnt     movlw   TXLEN+2
        xorwf   j,W
        btfsc   STATUS,Z
        goto    emit
        movlw   txbuf
        addwf   j,W
        movwf   FSR
        movf    INDF,F
        btfsc   STATUS,Z
        goto    emit
        incf    n,F
        incf    j,F
        goto    cnt
emit    movf    n,W
        call    put
em1     movf    j,W
        xorwf   i,W
        btfsc   STATUS,Z
        goto    em2
        movlw   txbuf
        addwf   i,W
        movwf   FSR
        movf    INDF,W
        call    put
        incf    i,F
        goto    em1
em2     movlw   TXLEN+2
        xorwf   j,W
        btfsc   STATUS,Z
        goto    em3
        incf    j,W
        movwf   i
        goto    blk
em3     movlw   .0
put     movwf   ch
        movf    head,W
        addlw   RING
        movwf   FSR
        movf    ch,W
        movwf   INDF
        incf    head,W
        andlw   RINGMSK
        movwf   head
        return

txpump  movf    head,W
        xorwf   tail,W
        btfsc   STATUS,Z
        return
        btfss   PIR1,TXIF
        return
        movf    tail,W
        addlw   RING
        movwf   FSR
        movf    INDF,W
        movwf   TXREG
        incf    tail,W
        andlw   RINGMSK
        movwf   tail
        return

; ---------------------------------------------------------------- CRC-16/IBM-3740, a byte at a time without a table
crcinit movlw   0xFF
        movwf   crch
        movwf   crcl
        return
crcb    xorwf   crch,W
        movwf   x
        swapf   x,W
        andlw   0x0F
        xorwf   x,F             ; x ^= x >> 4
        swapf   x,W
        movwf   swp
        andlw   0xF0
        xorwf   crcl,W
        movwf   crch            ; low ^ (x << 4)
        rlf     swp,W
        rlf     swp,F
        movf    swp,W
        andlw   0x1F
        xorwf   crch,F          ; ^ (x >> 3)
        movf    swp,W
        andlw   0xE0
        xorwf   x,W
        movwf   crcl            ; x ^ (x << 5)
        return
        end
