"""What is mutated: valid scenarios, a recording with its map, and the documents of the other commands."""

from __future__ import annotations

# Every kind of part in a run of a fraction of a second, so that what is accepted is checked quickly.
PARTS = """\
name: parts
seed: 7
duration: 0.2 s
settle: 0.1 s
bandwidth: 1 kHz
temperature: {start: 25 degC, steps: [{hold: 1 s}, {ramp: 40 degC, rate: 1 K/min}]}
turntable:
  preset: air_bearing
  mode: digital
  digital: {controller_rate: 20 kHz, encoder_bits: 30}
  cogging: [{torque: 1 mN*m, periods: 24}]
  floor:
    lines: [{axis: x, frequency: 30 Hz, displacement: 1 nm}]
    bands: [{axis: rz, low: 2 Hz, high: 80 Hz, angular_acceleration_psd: 1e-6 (rad/s^2)^2/Hz}]
  earth_rate: {latitude: 48 deg}
motion:
  - sine: {frequency: 0.5 Hz, angle: 5.555 mrad}
  - chirp: {start_frequency: 1 Hz, stop_frequency: 20 Hz, rate: 0.1 deg/s}
  - multisine: {frequencies: [1 Hz, 2 Hz, 3 Hz], rate: 0.1 deg/s}
  - random: {psd: 1e-6 (deg/s)^2/Hz, low: 1 Hz, high: 80 Hz}
  - reaction_wheel: {speed: 600 rev/min, inertia: 5 kg*m^2, harmonics: [{number: 1, coefficient: 13.7 g*cm^2}]}
sensors:
  mhd_ars: {preset: sx300}
  mems_gyro: {preset: adis16505_filtered}
  fog: {preset: fog_paper3, sample_rate: 1 kHz}
fusion:
  kalman: {q: 0.1 (deg/s)^2/s, belief: exact}
  arw_shakf: {belief: exact}
  mine:
    type: wideband
    belief:
      mhd_ars: {numerator: [1, 0], denominator: [1, 10], output_noise: 100 nrad/s/sqrt(Hz)}
      mems_gyro: {numerator: [1], denominator: [0.001, 1], output_noise: 100 urad/s/sqrt(Hz)}
      fog: {numerator: [1], denominator: [0.001, 1], output_noise: 100 urad/s/sqrt(Hz)}
expect:
  kalman: {rmse_deg_s: "< 0.0143"}
"""
TWO_PATHS = """\
name: two
duration: 0.1 s
turntable: {mode: ideal}
motion:
  - constant: {rate: 0.1 deg/s}
sensors:
  mhd_ars: {preset: sx300}
  mems_gyro: {preset: adis16505}
fusion:
  complementary: {}
  blending: {}
  steady_state: {frequency: 10 Hz, amplitude: 1 deg/s}
  shakf: {}
  allan_srkf: {}
"""
FIXED = """\
name: fixed
duration: 100 s
turntable: {mode: fixed}
motion:
  - static: {}
sensors:
  fog: {preset: fog_paper3}
"""
# Sensors that fail and lose readings; filters that begin late, adapt, and hold others inside.
TIMED = """\
name: timed
seed: 7
truth_seed: 8
duration: 0.3 s
fusion_from: 0.1 s
settle: 0.2 s
turntable: {preset: air_bearing, engine: modal}
motion:
  - sine: {frequency: 10 Hz, rate: 0.1 deg/s}
  - random: {psd: 1e-6 (deg/s)^2/Hz, low: 1 Hz, high: 80 Hz}
sensors:
  mhd_ars:
    preset: sx300
    faults: [{kind: stuck, at: 0.1 s, length: 10 ms}, {kind: rail, at: 0.15 s, length: 1 ms}]
    lost: {bursts: {every: 50 ms, length: 2 ms}}
  mems_gyro: {preset: adis16505_filtered}
fusion:
  wideband:
    belief:
      mhd_ars: {numerator: [1, 0], denominator: [1, 20, 100], output_noise: 100 nrad/s/sqrt(Hz), delay: 50 us}
      mems_gyro: {numerator: [0.99], denominator: [1], output_noise: 100 urad/s/sqrt(Hz), bias: 1 deg/h}
  vb_akf: {forget: 0.99, iterations: 3}
  imm: {ratios: [0.1, 10], sojourn: 0.5 s}
"""
POINTED = """\
name: pointed
duration: 0.3 s
settle: 0.1 s
turntable: {mode: ideal}
motion:
  - sine: {frequency: 10 Hz, rate: 0.1 deg/s}
sensors:
  mhd_ars: {preset: sx300, scale_factor_error: 1 %, delay: 500 us}
  mems_gyro: {preset: adis16505_filtered}
fusion:
  calibrated: {type: self_calibrating, filter: {kalman: {order: 3, q: 1e10 (deg/s)^2/s^5}}, gain_std: 0.02}
  late: {type: self_calibrating, filter: {wideband: {}}, delay_std: 1 ms, start: rest, rest_rate: 15 deg/h}
pointing:
  feed_forward: [calibrated]
  tracker: {bandwidth: 10 Hz, noise: 50 nrad/sqrt(Hz), fades: [{at: 0.1 s, length: 50 ms}]}
  mirror: {bandwidth: 1 kHz, latency: 500 us, lead: on, stroke: 1 mrad}
  windows: [1 ms, {length: 10 ms, separation: 50 ms}]
  link: {divergence: 20 urad, outage_below: -3 dB}
expect:
  calibrated: {residual_rms_urad: "< 100", rpe_urad: {1 ms: "< 10"}}
"""
CLOCKED = """\
name: clocked
duration: 0.2 s
turntable: {mode: ideal}
motion:
  - sine: {frequency: 10 Hz, rate: 0.1 deg/s}
sensors:
  mhd_ars: {preset: sx300, noise: off}
  mems_gyro:
    preset: adis16505_filtered
    sample_rate: 2003.704 Hz
    clock: {error: 20 ppm, walk: 100 ns, offset: 100 us}
    lost: {bursts: {every: 50 ms, length: 2 ms}}
fusion:
  kalman: {order: 3}
  arw_shakf: {start: rest}
"""
BASES = (PARTS, TWO_PATHS, FIXED, TIMED, POINTED, CLOCKED)

# A recording, and the map that reads it.
LOG = "t [us],w [deg/s],gy,angle\n" + "".join(f"{500 * k},{k % 7},{k % 5},{k}\n" for k in range(200))
MAP = """\
file: log.csv
separator: ","
decimal: "."
encoding: utf-8
skip: 0
channels:
  mhd_ars: {column: "w [deg/s]", unit: deg/s, sign: -1, range: 10 deg/s, time: {column: "t [us]", unit: us}}
  mems_gyro: {column: gy, scale: 0.07 deg/s, kind: rate, axis: z, time: {rate: 2000 Hz, offset: 1 ms}}
  reference: {column: 4, unit: arcsec, kind: angle, time: {column: 1, unit: us, epoch: 2024-05-01T12:00:00}}
"""
# What a map and two filters need to replay the recording.
BELIEF = """\
mhd_ars:
  numerator: [1, 0]
  denominator: [1, 20, 100]
  input_noise: 1 urad/s/sqrt(Hz)
  output_noise: 100 nrad/s/sqrt(Hz)
  delay: 50 us
  range: 10 deg/s
mems_gyro:
  numerator: [0.99]
  denominator: [1]
  output_noise: 100 urad/s/sqrt(Hz)
  bias: 1 deg/h
  noise_knee: 1 Hz
  resolution: 0.01 deg/s
"""
FUSION = """\
kalman: {order: 2, gate: off}
vb_akf: {forget: 0.99}
imm: {ratios: [0.1, 10]}
calibrated: {type: self_calibrating, filter: {wideband: {}}}
complementary: {belief: eq39}
"""
# A response to be identified: a reference and a sensor that reads it late, at another gain, with noise of its own.
RESPONSE = "t [us],laser [deg/s],gyro [deg/s]\n" + "".join(
    f"{1000 * k},{(7 * k * k) % 101 / 50:.2f},{0.9 * ((7 * k * k) % 101) / 50 + (k % 3) / 100:.3f}\n"
    for k in range(400)
)
# Quickly checked, for a study may have many cases.
BASE = """\
name: base
duration: 0.1 s
turntable: {mode: ideal}
motion:
  - constant: {rate: 0.1 deg/s}
sensors:
  mems_gyro: {preset: adis16505}
fusion:
  kalman: {}
"""
STUDY = """\
name: study
base: base.yaml
vary:
  motion.0.constant.rate: {log: [0.1 deg/s, 10 deg/s], points: 3}
  sensors.mems_gyro.bias_instability: [1 deg/h, 2 deg/h]
  sensors.mems_gyro.range: {random: [10 deg/s, 30 deg/s], points: 2}
draws: 2
seeds: {until: {rmse: 10 %}, most: 4}
"""
REQUIREMENT = """\
name: requirement
duration: 0.5 s
motion:
  - sine: {frequency: 10 Hz, rate: 0.1 deg/s}
sensors:
  mhd_ars: {preset: sx300, cost: 30}
  mems_gyro: {preset: adis16505_filtered, cost: 1}
fusion:
  kalman: {cost: 2}
trackers:
  coarse: {bandwidth: 10 Hz, cost: 5}
mirrors:
  plain: {bandwidth: 1 kHz, latency: 500 us, cost: 10}
rpe_urad: {100 ms: "< 0.25"}
residual_rms_urad: "< 1"
"""
VALID = {
    "map": MAP,
    "belief": BELIEF,
    "fusion": FUSION,
    "study": STUDY,
    "requirement": REQUIREMENT,
    "response": RESPONSE,
    "options": '["replay", "log.csv", "--map", "map.yaml", "--filter=kalman", "--out=replayed"]',
}
