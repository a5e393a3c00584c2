"""A flight small enough to fly many times: Aqua by a flat renderer, 64 × 48 pixels, true keypoints."""

SCENARIO = """\
target: {name: aqua}
orbit:
  elements: {epoch_utc: 2022-01-31T02:02:27.58, a_m: 7080000, e: 0.001, i_deg: 98, raan_deg: 10,
             argp_deg: 20, mean_anomaly_deg: 30}
relative: {state_rtn: {r_m: [2, -45, 5], v_m_s: [0, 0, 0]}}
attitude: {target: {law: nadir}, camera: {law: track, offset: 0}}
camera: {width_px: 64, height_px: 48, hfov_deg: 60}
sky: {earth: false, stars: null}
sensor: {noise: {gaussian_dn: 3}}
renderer: {name: flat, seconds: 0}
annotators: [box, mask, keypoints, pose]
writers: []
seed: 7
flight:
  duration_s: 80
  goal: {waypoints: [{t_s: 60, r_rtn_m: [0, -40, 4], hold_s: 20}]}
  measurement: {source: truth, sigma_px: 0.5}
"""

NATURAL = (
    SCENARIO[: SCENARIO.index("flight:")]
    .replace("e: 0.001", "e: 0")
    .replace("width_px: 64, height_px: 48", "width_px: 160, height_px: 120")
    + "times: {duration_s: 590, count: 60}\n"
)
"""A natural motion beside a target that turns at a constant rate: 60 frames, one every 10 s."""
