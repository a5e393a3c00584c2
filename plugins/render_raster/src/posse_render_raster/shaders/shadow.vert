#version 330 core
uniform mat4 shadow_from_link;

in vec3 position_link_m;

void main() {
    gl_Position = shadow_from_link * vec4(position_link_m, 1.0);
}
