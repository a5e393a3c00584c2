#version 330 core
// All vectors are in camera axes (x right, y down, z forward), in metres.
uniform mat3 R_cam_from_link;
uniform vec3 t_link_cam_m;
uniform vec4 focal_and_centre;  // a sample's position is focal * xy / z + centre, in −1 … 1
uniform vec2 clip_m;

in vec3 position_link_m;
in vec3 normal_link;
in vec2 uv;

invariant gl_Position;  // bit for bit the same in the depth program
out vec3 position_m;
out vec3 normal;
out vec2 texture_uv;

void main() {
    position_m = R_cam_from_link * position_link_m + t_link_cam_m;
    normal = R_cam_from_link * normal_link;
    texture_uv = vec2(uv.x, 1.0 - uv.y);  // row 0 of a texture is at v = 1
    float z = position_m.z, near = clip_m.x, far = clip_m.y;
    gl_Position = vec4(
        focal_and_centre.xy * position_m.xy + focal_and_centre.zw * z,
        ((far + near) * z - 2.0 * far * near) / (far - near),
        z
    );
}
