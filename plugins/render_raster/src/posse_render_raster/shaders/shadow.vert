#version 330 core
uniform mat4 shadow_from_body;

in vec3 position_body_m;

void main() {
    gl_Position = shadow_from_body * vec4(position_body_m, 1.0);
}
