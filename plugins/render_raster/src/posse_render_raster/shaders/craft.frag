#version 330 core
// glTF 2.0 metallic-roughness (specification, appendix B) under the Sun and an environment map.
const float PI = 3.14159265358979;
const float PREFILTERED_STEP = 0.25;  // difference in roughness between the layers of prefiltered
// Radiance is not linear in roughness and normal. Both are therefore read two mipmap levels finer than
// usual, and the radiance is averaged over the samples of a pixel instead.
const float FINER = -2.0;
const float DIFFUSE_LAYER = 4.0;
const float STEEPEST = 20.0;  // largest slope of a face, seen from the Sun, for the shadow map's offset

uniform bool has_sun;
uniform vec3 sun_direction;
uniform vec3 sun_irradiance_rgb_w_m2;
uniform float sun_angular_radius_rad;
uniform mat4 shadow_from_cam;
uniform float shadow_texel_m;
uniform float shadow_share;             // of the texture's width and height that the map takes
uniform sampler2DShadow shadow_map;

uniform bool has_environment;
uniform sampler2D environment;          // radiance, as in posse_core.EnvironmentMap
uniform sampler2DArray prefiltered;     // lobes of roughness ¼ ½ ¾ 1, then the cosine lobe
uniform sampler2D lobe_albedo;          // (n·v, roughness) → scale and bias of F0

uniform vec3 base_color;
uniform float metallic, roughness, specular;
uniform bool has_normal_map;
uniform sampler2D base_color_texture, metallic_roughness_texture, normal_texture;

in vec3 position_m;
in vec3 normal;
in vec2 texture_uv;

out vec4 radiance_and_z;

vec2 map_uv(vec3 d) {
    return vec2(atan(d.x, d.z) / (2.0 * PI) + 0.5, acos(clamp(-d.y, -1.0, 1.0)) / PI);
}

// The normal, and the amount that the spread of normals below it adds to a lobe's alpha².
vec4 mapped_normal(vec3 n) {
    // The tangents follow from the derivatives of position and texture coordinates.
    vec3 dp_x = dFdx(position_m), dp_y = dFdy(position_m);
    vec2 dt_x = dFdx(texture_uv), dt_y = dFdy(texture_uv);
    vec3 across_x = cross(n, dp_x), across_y = cross(dp_y, n);
    float side = dot(dp_x, across_y);
    vec3 tangent = (across_y * dt_x.x + across_x * dt_y.x) * sign(side);
    vec3 down = (across_y * dt_x.y + across_x * dt_y.y) * sign(side);
    float scale = inversesqrt(max(max(dot(tangent, tangent), dot(down, down)), 1e-30));
    vec3 t = texture(normal_texture, texture_uv, FINER).xyz;
    // The mean of differing normals is shorter than 1; its length gives the variance of their slopes
    // (Toksvig 2005).
    float size = length(t);
    vec3 mapped = normalize(tangent * scale * t.x - down * scale * t.y + n * t.z);
    return vec4(mapped, 2.0 * max(1.0 - size, 0.0) / size);
}

float sun_visible(vec3 face_normal) {
    float n_l = dot(face_normal, sun_direction);
    if (n_l <= 0.0) return 0.0;
    // The shadow map holds the depth of texel centres, so a sloping face would shade itself. The point is
    // therefore moved towards the Sun by the change of depth over a texel. A move along the face's normal
    // would shift the edges of shadows.
    float slope = min(sqrt(max(1.0 - n_l * n_l, 0.0)) / n_l, STEEPEST);
    float lift = shadow_texel_m * (0.2 + 1.5 * slope);
    vec4 position = shadow_from_cam * vec4(position_m + lift * sun_direction, 1.0);
    return texture(shadow_map, (position.xyz * 0.5 + 0.5) * vec3(shadow_share, shadow_share, 1.0));
}

void main() {
    vec3 v = normalize(-position_m);
    vec3 face_normal = normalize(cross(dFdx(position_m), dFdy(position_m)));
    if (dot(face_normal, v) < 0.0) face_normal = -face_normal;
    vec3 n = normalize(normal);
    bool behind = dot(n, face_normal) < 0.0;  // both sides of a face are visible
    float widening = 0.0;
    if (has_normal_map) {
        vec4 mapped = mapped_normal(n);
        n = mapped.xyz;
        widening = mapped.w;
    }
    if (behind) n = -n;

    vec3 color = base_color * texture(base_color_texture, texture_uv).rgb;
    vec2 both = texture(metallic_roughness_texture, texture_uv, FINER).rg;
    float metal = metallic * both.x, rough = roughness * both.y;
    rough = pow(min(rough * rough * rough * rough + widening, 1.0), 0.25);
    vec3 f0 = mix(vec3(0.04 * specular), color, metal);
    float f90 = mix(specular, 1.0, metal);
    vec3 diffuse = color * (1.0 - metal) / PI;  // that of the dielectric share, below its own coat alone
    float n_v = max(dot(n, v), 1e-4);

    vec3 radiance = vec3(0.0);
    float n_l = dot(n, sun_direction);
    if (has_sun && n_l > 0.0) {
        vec3 h = normalize(v + sun_direction);
        float n_h = max(dot(n, h), 0.0), v_h = clamp(dot(v, h), 0.0, 1.0);
        // The Sun's disc widens the lobe, so that a mirror shows the right E/(π σ²) at its centre.
        float half_disc = 0.5 * sun_angular_radius_rad;
        float a2 = rough * rough * rough * rough + half_disc * half_disc;
        // 1 − n_h² is computed as |n × h|², because rounding of the difference would spoil a mirror's lobe.
        vec3 off = cross(n, h);
        float d = n_h * n_h * a2 + dot(off, off);
        float distribution = a2 / (PI * d * d);
        float shadowing = 0.5 / (n_l * sqrt(n_v * n_v * (1.0 - a2) + a2)
                               + n_v * sqrt(n_l * n_l * (1.0 - a2) + a2));
        float edge = pow(1.0 - v_h, 5.0);
        vec3 fresnel = f0 + (f90 - f0) * edge;
        float coat = specular * (0.04 + 0.96 * edge);
        vec3 reflected = diffuse * (1.0 - coat) + fresnel * distribution * shadowing;
        radiance += sun_visible(face_normal) * sun_irradiance_rgb_w_m2 * n_l * reflected;
    }
    if (has_environment) {
        vec2 albedo = texture(lobe_albedo, vec2(n_v, rough)).rg;
        vec3 fresnel = f0 * albedo.x + f90 * albedo.y;
        vec2 mirrored = map_uv(reflect(-v, n));
        float layer = rough / PREFILTERED_STEP - 1.0;
        vec3 lobe;
        if (layer <= 0.0) {
            lobe = mix(texture(environment, mirrored).rgb,
                       texture(prefiltered, vec3(mirrored, 0.0)).rgb, layer + 1.0);
        } else {
            lobe = mix(texture(prefiltered, vec3(mirrored, floor(layer))).rgb,
                       texture(prefiltered, vec3(mirrored, ceil(layer))).rgb, fract(layer));
        }
        float coat = specular * (0.04 * albedo.x + albedo.y);
        vec3 even = texture(prefiltered, vec3(map_uv(n), DIFFUSE_LAYER)).rgb;
        radiance += lobe * fresnel + even * PI * diffuse * (1.0 - coat);
    }
    radiance_and_z = vec4(radiance, position_m.z);
}
